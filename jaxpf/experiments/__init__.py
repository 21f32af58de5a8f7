"""Experiments: scenes, methods and published numbers, put side by side."""
