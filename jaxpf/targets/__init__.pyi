from .building import factory as factory, looks_of as looks_of
from .registry import (
    DEFAULT as DEFAULT,
    all_targets as all_targets,
    find_target as find_target,
    register as register,
    target_of_scene as target_of_scene,
)
from .target import Looks as Looks, Marks as Marks, Start as Start, Target as Target
