"""How a part moves with the part it hangs on."""

from jaxpf.models.joints import (
    RelativeToParent,
    UniformAround,
    UniformJoints,
    joints_between,
    place,
    substates_at,
)

__all__ = [
    "RelativeToParent",
    "UniformAround",
    "UniformJoints",
    "joints_between",
    "place",
    "substates_at",
]
