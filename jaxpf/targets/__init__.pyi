from .registry import (
    DEFAULT as DEFAULT,
    adapter_of_scene as adapter_of_scene,
    adapters as adapters,
    find_adapter as find_adapter,
)
