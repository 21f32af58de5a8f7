"""Atomic writing, locks, the resumable store and saved states."""
