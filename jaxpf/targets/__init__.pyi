from .registry import (
    DEFAULT as DEFAULT,
    all_targets as all_targets,
    find_target as find_target,
    target_of_scene as target_of_scene,
)
