"""Schedules, executes, stores and resumes the runs of an evaluation."""
