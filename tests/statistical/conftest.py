"""Statistical tests run in float64, and leave other tests of the same process in float32."""

import jax
import pytest


@pytest.fixture(autouse=True, scope="module")
def _float64():
    with jax.enable_x64(True):
        yield
