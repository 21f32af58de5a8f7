"""Names of the labelled filter's choices.  Imports no JAX."""

#: How particles are weighed when they are resampled (rowe2005, eq. 4, and without it).
WEIGHTS = ("equal_share", "plain", "corrected")
#: What is resampled together.
SCOPES = ("across", "within")
#: The speed that moves the particles: their own, or the estimate's (rowe2005, eq. 5).
FEEDBACKS = ("none", "estimate")
#: Whether targets come and go.
POPULATIONS = ("fixed", "open")
