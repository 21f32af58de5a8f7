"""Helpers that make the compiler generate fast code; each name states its intent.

``branches``
    ``choose`` between two computations, ``computed_once`` and ``computed_before``.
``derivatives``
    ``with_gradient_of`` gives a value another's derivative; ``weighted`` products without NaN.
``columns``
    Sums, gathers and draws of rows in a form that vectorises.
``integers``
    Division and sorting of integers.
``platform``
    Whether programs run on an accelerator, on which the fastest form depends.
``prefix``
    Running sums and maxima.
``programs``
    ``compiled``: ``jax.jit`` with full products on an accelerator.
``threefry``
    JAX's random numbers, drawn faster.
"""
