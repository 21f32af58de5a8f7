"""When an object counts as lost: one rule for tables, verdicts, plots, overlays and exports.

Imports no JAX.
"""

import numpy as np
from numpy.typing import ArrayLike

#: Objects with confidence (``jaxpf.Summary``) below this level are lost.
LOST_BELOW = 0.5


def judge(
    outside: ArrayLike, without_likelihood: ArrayLike, confidence: ArrayLike | None = None
) -> tuple[np.ndarray | None, np.ndarray]:
    """Confidence in the reported positions of P objects in one frame, and whether they are lost.

    An object is lost where it is ``outside`` the picture, where all particles have likelihood zero,
    or where its confidence, see ``jaxpf.Summary``, is below ``LOST_BELOW``.  In the first two cases
    its confidence is 0.  All are ``[P]``; without a confidence, None is returned for it.
    """
    gone = np.asarray(outside, bool) | np.asarray(without_likelihood, bool)
    if confidence is None:
        return None, gone
    confidence = np.where(gone, 0.0, confidence)
    return confidence, confidence < LOST_BELOW
