"""rowe2005 repeated, see ``study``."""
