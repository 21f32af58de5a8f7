"""Labelled particles (rowe2005): one sample set for many targets, each particle holds one."""
