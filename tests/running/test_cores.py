"""How runs use the cores of a CPU."""

import os
import subprocess
import sys
import warnings

import jax
import numpy as np
import pytest
from models import Adding

import jaxpf
from jaxpf import InputError
from jaxpf.lowering import platform
from jaxpf.running import cores


def run(count, **given):
    keys = jax.random.split(jax.random.key(0), count)
    return jaxpf.monte_carlo(Adding(), keys, np.ones(3, np.float32), **given)


def test_idle_cores_are_said_once(monkeypatch):
    monkeypatch.setattr(platform, "on_accelerator", lambda: False)
    monkeypatch.setattr(cores, "num_cores", lambda: 8)
    cores.say_that_cores_are_idle.cache_clear()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        run(2)  # one block, which other cores could not share
        run(10, devices=jax.devices())
    with pytest.warns(UserWarning, match=r"one of 8 cores; to use all, call jaxpf.use_cores\(\)"):
        run(10)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        run(10)


def test_use_cores_comes_before_jax_starts():
    jax.devices()
    with pytest.raises(InputError, match="JAX has already started with 1 of 5 cores; call jaxpf"):
        jaxpf.use_cores(5)
    with pytest.raises(InputError, match="cores = 0 must be a whole number from 1"):
        jaxpf.use_cores(0)
    program = "import jax, jaxpf; jaxpf.use_cores(3); print(len(jax.devices()), jaxpf.use_cores(3))"
    on_cpu = os.environ | {"JAX_PLATFORMS": "cpu"}
    command = [sys.executable, "-c", program]
    done = subprocess.run(command, capture_output=True, text=True, env=on_cpu)
    assert done.stdout.strip() == "3 3", done
