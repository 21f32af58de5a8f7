"""Names of choices that several packages share.  Imports no JAX."""

#: Named orderings of the partitioned filter on the command line.
METHODS = ("sir", "ps", "dps", "sps")
#: Orders of ps by name: as the objects are listed (a part tree level by level), and every circular
#: shift of that order.
ORDERS = GIVEN, SHIFTS = ("given", "shifts")
#: Exchange rules of simultaneous partitioned sampling, in the order of their codes.
SWAPS = ("none", "random", "sorted", "combinatorial")
#: Rules that reassemble the components of DPS at the end of a frame.
REASSEMBLIES = ("evidence", "literal")
#: Resampling schemes.
SCHEMES = ("systematic", "stratified", "multinomial", "residual")
#: Gradient strategies for resampling.
GRADIENTS = ("none", "stop_gradient", "soft", "transport")
#: Gradient strategies for the motion.
MOTION_GRADIENTS = ("pathwise", "score")
#: Objectives of tuning.
OBJECTIVES = ("evidence", "position", "iou", "crps")
#: How the squared differences of a window are combined.
NORMS = ("mean", "sum")
#: How parts move: with their parents, or each on its own.
PART_DYNAMICS = ("relative", "absolute")
#: Shape spaces of contours that need no training examples.
SHAPE_SPACES = ("translation", "similarity", "affine")
#: Exclusion between contours: as wire frames, as opaque bodies, or none; the ``-literal`` variants
#: follow maccormick1999 as printed.
EXCLUSIONS = ("wires", "opaque", "none", "wires-literal", "opaque-literal", "none-literal")
#: Annotation formats of contours.
ANNOTATIONS = ("masks", "outlines", "centrelines")
#: Structure of learned dynamics: what a coordinate depends on.  Its own last steps; its own past,
#: with a mean to which it returns; or the past of all coordinates.
COEFFICIENTS = ("steps", "own", "all")
