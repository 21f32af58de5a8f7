"""gonzales2011 repeated, see ``study``."""
