"""Whether XLA's compiler for CPUs still has its older emitters.

Where little or nothing is optimised they take half as long as the new ones.  jaxlib 0.12 has none,
and ends a process that asks for them.
"""

from importlib.metadata import version

HAS_OLDER_EMITTERS = tuple(map(int, version("jaxlib").split(".")[:2])) < (0, 11)
