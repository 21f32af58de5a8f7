"""Names that people choose by, and a level that several rooms speak of.  Imports no JAX."""

#: Orderings of the partitioned filter that have a name on the command line.
METHODS = ("sir", "ps", "dps", "sps")
#: Methods of the factored filter.
FACTORED_METHODS = ("eskil", "pffl")
#: How partitions of eskil2014 carry one another along, and how they hold one another in place.
DRIFTS = ("clip", "signed", "literal", "ridge", "none")
SHAPES = ("relative", "pixels", "none")
#: How PFFL weighs its particles.
FORMS = ("auxiliary", "literal")
#: Exchange rules of simultaneous partitioned sampling, in the order of their codes.
SWAPS = ("none", "random", "sorted", "combinatorial")
#: How the components of DPS are put together again at the end of a frame.
REASSEMBLIES = ("evidence", "literal")
#: Resampling schemes.
SCHEMES = ("systematic", "stratified", "multinomial", "residual")
#: What resampling passes on to a derivative.
GRADIENTS = ("none", "stop_gradient", "soft", "transport")
#: How the motion is differentiated.
MOTION_GRADIENTS = ("pathwise", "score")
#: What tuning makes large or small.
OBJECTIVES = ("evidence", "position", "overlap", "crps")
#: Shape spaces of contours that need no examples.
SHAPE_SPACES = ("translation", "similarity", "affine")
#: How contours exclude one another: as wire frames, as opaque bodies, or not at all; and the first
#: two as maccormick1999 prints them.
EXCLUSIONS = ("wires", "opaque", "none", "wires-literal", "opaque-literal", "none-literal")
#: What an annotator marks of a contour.
ANNOTATIONS = ("masks", "outlines", "centrelines")
#: What of the past may act on a coordinate, in dynamics that are learned: its own last steps; its
#: own past, with a place to which it returns; or every coordinate's past.
COEFFICIENTS = ("steps", "own", "all")

#: An object whose confidence (``jaxpf.Summary``) is below this is probably lost.
PROBABLY_LOST = 0.5
