"""Run measurements in parts that are stored on disk."""
