"""Versions of the software that results depend on."""

import platform
from importlib.metadata import PackageNotFoundError, version

_PACKAGES = ("jaxpf", "jax", "jaxlib", "optax", "chex", "numpy", "opencv-python-headless")


def versions() -> dict[str, str]:
    """Return the versions of Python, the platform and the packages that results depend on."""
    by_name = {"python": platform.python_version(), "platform": platform.platform()}
    for package in _PACKAGES:
        try:
            by_name[package] = version(package)
        except PackageNotFoundError:
            by_name[package] = "unknown"
    return by_name
