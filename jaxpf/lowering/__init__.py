"""What is written for the compiler's sake, and nothing else; each name says its intent.

``branches``
    ``choose`` between two computations, one ``computed_once``, a tree ``computed_before``.
``derivatives``
    A value ``with_gradient_of`` another; a sum's terms ``weighted`` without NaN.
``columns``
    Rows of numbers summed, picked and drawn in the form that vectorises.
``integers``
    Whole numbers divided and put in order.
``prefix``
    Running sums and maxima.
``threefry``
    JAX's own random numbers, drawn faster.
"""
