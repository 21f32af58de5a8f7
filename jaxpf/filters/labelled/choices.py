"""Names of the labelled filter's choices.  Imports no JAX."""

#: How particles are weighed when they are resampled (rowe2005, eq. 4, and without it).
WEIGHTS = ("equal_share", "plain", "corrected")
#: What is resampled together.
SCOPES = ("across", "within")
#: Whose speed moves the particles (rowe2005, eq. 5).
FEEDBACKS = ("none", "estimate")
#: Whether targets come and go.
POPULATIONS = ("fixed", "open")
