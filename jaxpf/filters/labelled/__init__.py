"""Labelled particles (rowe2005): one particle set for many targets; each particle holds one."""
