"""``jax.jit`` for the tests' small programs, which cost more to compile than to run."""

from functools import partial

import jax
from older_emitters import HAS_OLDER_EMITTERS

#: A fraction of the time to compile; the arithmetic is the same, but for the last bits.
QUICKLY = {
    "xla_backend_optimization_level": 0,
    "xla_llvm_disable_expensive_passes": True,
}
if HAS_OLDER_EMITTERS:
    QUICKLY["xla_cpu_use_fusion_emitters"] = False
quick = partial(jax.jit, compiler_options=QUICKLY)
