"""maccormick1999 repeated, see ``study``."""
