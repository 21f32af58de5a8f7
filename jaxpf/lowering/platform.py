"""The kind of device that programs are written for."""


def on_accelerator() -> bool:
    """Whether programs run on a GPU or TPU.

    The only place that decides.  Many small kernels and branches are slow there, and so are loops
    over blocks; wide arrays are fast.  (Not ``lax.platform_dependent``, which traces both forms at
    every call: the form for accelerators dominated the time to trace a filter.)
    """
    import jax  # not above: the command line's help reads this module

    return jax.default_backend() != "cpu"
