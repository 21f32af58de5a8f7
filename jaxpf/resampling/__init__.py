"""Resampling schemes and weighted resampling: from weights to ancestors.

A custom scheme is a registered pytree (a class by ``jaxpf.pytree_dataclass``, or a function by
``jax.tree_util.Partial``).  It works wherever a name in ``SCHEMES`` does, as in
``jaxpf.Partitioned(resampling=...)``::

    __call__(key, log_weights [N], count) -> ancestors [count]

It must be unbiased: a particle of weight w_i has ``count * w_i`` offspring on average, and none if
w_i is zero.  The weights sum to one, and ``count`` is a Python int.  Filters use it within
components and labels like the built-in schemes.  With C components it draws N ancestors in each,
C times the work, and a component of n slots keeps n of its N draws, evenly spaced.
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
