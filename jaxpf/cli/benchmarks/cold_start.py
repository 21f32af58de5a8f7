"""A reproduction from a cold start, compilation included."""

import os
import subprocess
import sys
import tempfile
import time

_COLD_START = """
from jaxpf.cli.shared.startup import start_jax
start_jax()
from jaxpf.papers.smith2004.scenes import RUNS_PER_SCENE, all_orderings, measure
from jaxpf.papers.smith2004.published import RUNS
chosen = {n: o for n, o in all_orderings().items() if n not in ("DPS evidence", "SPS")}
measure(range(RUNS // RUNS_PER_SCENE), orderings=chosen)
"""


def cold_reproduction() -> float:
    """Seconds for smith2004's tables 1 and 2 in a new process without any compiled kernel.

    4 values of sharpness x (50 runs of Non-PS, 7 x 50 of PS, 50 of DPS): 1800 runs.
    """
    with tempfile.TemporaryDirectory() as empty:
        environment = os.environ | {"JAXPF_CACHE_DIR": empty}
        began = time.perf_counter()
        subprocess.run([sys.executable, "-c", _COLD_START], env=environment, check=True)
        return time.perf_counter() - began
