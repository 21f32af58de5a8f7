"""Compile functions so that they multiply matrices exactly on every device."""

import functools
from collections.abc import Callable
from typing import Any

import jax

from jaxpf.lowering import platform


def compiled(function: Callable, **options: Any) -> Any:
    """``jax.jit(in_full(function), **options)``."""
    return jax.jit(in_full(function), **options)


def in_full(function: Callable) -> Callable:
    """Multiply in the full precision of the factors, on an accelerator as on a CPU.

    By default a GPU rounds the factors of a float32 product to ten bits: 1000 pixels become 1000.5.
    Functions of a user's model are computed in full too, unless the user sets
    ``jax_default_matmul_precision`` or gives a product's precision.
    """

    @functools.wraps(function)
    def call(*arguments, **named):
        asked = jax.config.jax_default_matmul_precision  # type: ignore[attr-defined]
        if asked is not None or not platform.on_accelerator():
            return function(*arguments, **named)
        with jax.default_matmul_precision("highest"):
            return function(*arguments, **named)

    return call
