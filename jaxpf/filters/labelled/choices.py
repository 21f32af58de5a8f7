"""Names of the labelled filter's choices.  Imports no JAX."""

#: Weighting rules for resampling: rowe2005's eq. 4, none, or eq. 4 with corrected weights.
WEIGHTS = ("equal_share", "plain", "corrected")
#: Whether resampling mixes labels.
SCOPES = ("across", "within")
#: The speed that moves particles: their own, or the estimate's (rowe2005, eq. 5).
FEEDBACKS = ("none", "estimate")
#: Whether targets may appear and disappear.
POPULATIONS = ("fixed", "open")
