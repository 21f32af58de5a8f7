"""smith2004 repeated, see ``study``."""
