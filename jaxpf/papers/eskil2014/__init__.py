"""eskil2014 repeated, see ``study``."""
