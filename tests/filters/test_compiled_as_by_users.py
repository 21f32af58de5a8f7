"""Every filter, compiled as users compile it: the quick tests' compiler optimises nothing."""

import os

import jax
import numpy as np
import pytest
from models import walks

import jaxpf
from jaxpf import ordering

START = np.array([[0.0], [3.0]], np.float32)
MODEL = walks() | {"initial": START, "num_particles": 40}
FRAMES = START + np.random.default_rng(0).normal(size=(3, 2, 1)).astype(np.float32)
#: Whatever XLA_FLAGS say.
AS_BY_USERS = {
    "xla_backend_optimization_level": 3,
    "xla_llvm_disable_expensive_passes": False,
}
if "use_fusion_emitters" in os.environ.get("XLA_FLAGS", ""):
    AS_BY_USERS["xla_cpu_use_fusion_emitters"] = True

FILTERS = {
    # One program with SIR, PS and DPS.
    "sps": lambda: jaxpf.Partitioned(ordering=ordering.sps(num_partitions=2), **MODEL),
    "labelled": lambda: jaxpf.Labelled(**MODEL),
    "pffl": lambda: jaxpf.PFFL(**MODEL),
    "eskil": lambda: jaxpf.Eskil(**MODEL),
}


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(n, marks=pytest.mark.slow if n in ("labelled", "eskil") else ())
        for n in FILTERS
    ],
)
def test_optimising_changes_the_last_bits_alone(name):
    def results(tracker, key, frames):
        summary = jaxpf.run(tracker, key, frames)[1]
        return summary.estimate, summary.log_evidence, summary.spread

    given = FILTERS[name](), jax.random.key(0), FRAMES
    lowered = jax.jit(results).lower(*given)
    expected, found = (lowered.compile(options)(*given) for options in (None, AS_BY_USERS))
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-4, atol=1e-4)
