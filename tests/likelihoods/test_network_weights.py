"""The network of pretrained features, and files of its weights: read, or refused."""

import collections
import io
import pickle
import sys
import types
import zipfile

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxpf import InputError
from jaxpf.likelihoods.pretrained import efficientnet_lite0
from jaxpf.likelihoods.pretrained.weights import read_weights

#: Blocks of EfficientNet-lite0: kernel, stride, input channels, expanded and output channels.
_LAYERS = [
    (3, 1, 32, 32, 16), (3, 2, 16, 96, 24), (3, 1, 24, 144, 24), (5, 2, 24, 144, 40),
    (5, 1, 40, 240, 40), (3, 2, 40, 240, 80), (3, 1, 80, 480, 80), (3, 1, 80, 480, 80),
    (5, 1, 80, 480, 112), (5, 1, 112, 672, 112), (5, 1, 112, 672, 112),
]  # fmt: skip


def random_weights():
    rng, weights = np.random.default_rng(0), {}

    def layer(name, norm, *shape):
        fan = np.prod(shape[1:])
        weights[f"{name}.weight"] = rng.normal(size=shape).astype(np.float32) / np.sqrt(fan)
        for of, low, high in (
            ("weight", 0.5, 2), ("bias", -1, 1), ("running_mean", -1, 1), ("running_var", 0.5, 2),
        ):  # fmt: skip
            weights[f"{norm}.{of}"] = rng.uniform(low, high, shape[0]).astype(np.float32)

    layer("_conv_stem", "_bn0", 32, 3, 3, 3)
    for number, (kernel, _, inside, wide, outside) in enumerate(_LAYERS):
        of = f"_blocks.{number}."
        if wide != inside:
            layer(f"{of}_expand_conv", f"{of}_bn0", wide, inside, 1, 1)
        layer(f"{of}_depthwise_conv", f"{of}_bn1", wide, 1, kernel, kernel)
        layer(f"{of}_project_conv", f"{of}_bn2", outside, wide, 1, 1)
    return weights


def reference_maps(weights, window):
    """The maps by XLA's convolutions, with each normalisation after its convolution."""

    def layer(maps, name, norm, stride=1, groups=1):
        maps = jax.lax.conv_general_dilated(
            maps, weights[f"{name}.weight"], (stride, stride), "SAME",
            dimension_numbers=("NHWC", "OIHW", "NHWC"), feature_group_count=groups,
        )  # fmt: skip
        mean, variance, factor, shift = (
            weights[f"{norm}.{of}"] for of in ("running_mean", "running_var", "weight", "bias")
        )
        return (maps - mean) / jnp.sqrt(variance + 1e-3) * factor + shift

    maps = ((window * 255 - 127) / 128)[None]
    maps = jnp.clip(layer(maps, "_conv_stem", "_bn0", 2), 0, 6)
    taken = []
    for number, (_, stride, inside, wide, outside) in enumerate(_LAYERS):
        of, before = f"_blocks.{number}.", maps
        if wide != inside:
            maps = jnp.clip(layer(maps, f"{of}_expand_conv", f"{of}_bn0"), 0, 6)
        maps = jnp.clip(layer(maps, f"{of}_depthwise_conv", f"{of}_bn1", stride, wide), 0, 6)
        maps = layer(maps, f"{of}_project_conv", f"{of}_bn2")
        if stride == 1 and inside == outside:
            maps = maps + before
        if number in (4, 10):
            taken.append(maps[0])
    return taken


def test_the_network_is_efficientnet_lite0(tmp_path):
    weights = random_weights()
    np.savez(tmp_path / "weights.npz", **weights)
    network = efficientnet_lite0(tmp_path / "weights.npz")
    window = np.random.default_rng(1).random((64, 96, 3), np.float32)
    maps, expected = jax.jit(network)(window), jax.jit(reference_maps)(weights, window)
    assert [each.shape for each in maps] == [(8, 12, 40), (4, 6, 112)]
    for one, other in zip(maps, expected, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-3, atol=1e-3 * np.abs(other).max())


def test_weights_that_lack_an_array_or_have_other_sizes_are_refused(tmp_path):
    path, weights = tmp_path / "weights.npz", random_weights()
    np.savez(path, other=np.zeros(3))
    with pytest.raises(InputError, match=r"lack '_blocks\.0\._bn1\.running_mean'"):
        efficientnet_lite0(path)
    name = "_blocks.3._project_conv.weight"
    np.savez(path, **weights | {name: weights[name][:, :7]})
    with pytest.raises(InputError, match="other sizes than EfficientNet-lite0's"):
        efficientnet_lite0(path)


@pytest.fixture
def torch(monkeypatch):
    """What a pickle of PyTorch names: classes of storages, and a function that makes tensors."""
    module, utils = types.ModuleType("torch"), types.ModuleType("torch._utils")
    module.FloatStorage = type("FloatStorage", (), {"__module__": "torch"})
    utils._rebuild_tensor_v2 = lambda *_: None
    utils._rebuild_tensor_v2.__module__ = "torch._utils"
    utils._rebuild_tensor_v2.__qualname__ = "_rebuild_tensor_v2"
    monkeypatch.setitem(sys.modules, "torch", module)
    monkeypatch.setitem(sys.modules, "torch._utils", utils)
    return module, utils


def pickled(torch, arrays, offset=0):
    module, utils = torch
    file = io.BytesIO()

    class Tensor:
        def __init__(self, name):
            self.name = name

    class Pickler(pickle.Pickler):
        def persistent_id(self, obj):
            if not (isinstance(obj, tuple) and obj and obj[0] == "storage"):
                return None
            return ("storage", module.FloatStorage, obj[1], "cpu", arrays[obj[1]].size)

        def reducer_override(self, obj):
            if not isinstance(obj, Tensor):
                return NotImplemented
            array = arrays[obj.name]
            strides = tuple(step // 4 for step in array.strides)
            storage = ("storage", obj.name)
            rest = (storage, offset, array.shape, strides, False, collections.OrderedDict())
            return utils._rebuild_tensor_v2, rest

    Pickler(file, 2).dump(collections.OrderedDict((name, Tensor(name)) for name in arrays))
    return file.getvalue()


ARRAYS = {
    "a": np.arange(6, dtype=np.float32).reshape(2, 3),
    "b": np.ones((1, 2, 2), np.float32),
    "scalar": np.float32(3).reshape(()),
}


def test_weights_of_both_formats_of_pytorch_are_read(torch, tmp_path):
    new, old = tmp_path / "new.pth", tmp_path / "old.pth"
    with zipfile.ZipFile(new, "w") as file:
        file.writestr("model/data.pkl", pickled(torch, ARRAYS))
        for name, array in ARRAYS.items():
            file.writestr(f"model/data/{name}", array.tobytes())
    with old.open("wb") as file:
        for each in (0x1950A86A20F9469CFC6C, 1001, {}):
            pickle.dump(each, file, 2)
        file.write(pickled(torch, ARRAYS))
        pickle.dump(list(ARRAYS), file, 2)
        for array in ARRAYS.values():
            file.write(np.int64(array.size).tobytes() + array.tobytes())
    for path in (new, old):
        read = read_weights(path)
        assert read.keys() == ARRAYS.keys()
        for name, array in ARRAYS.items():
            np.testing.assert_array_equal(read[name], array)


@pytest.mark.parametrize("offset", [1, -1, 10**12])
def test_tensors_outside_their_storage_are_refused(torch, tmp_path, offset):
    path = tmp_path / "model.pth"
    with zipfile.ZipFile(path, "w") as file:
        file.writestr("model/data.pkl", pickled(torch, ARRAYS, offset))
        for name, array in ARRAYS.items():
            file.writestr(f"model/data/{name}", array.tobytes())
    with pytest.raises(InputError, match="outside its storage"):
        read_weights(path)


class Harmful:
    def __reduce__(self):
        return print, ("harm",)


@pytest.mark.parametrize(
    "content",
    [pickle.dumps({"a": Harmful()}, 2), b"", b"no pickle", pickle.dumps([1, 2], 2) * 5],
    ids=["code", "empty", "text", "lists"],
)
def test_files_that_hold_more_than_tensors_are_refused(content, tmp_path, capsys):
    path = tmp_path / "weights.pth"
    path.write_bytes(content)
    with pytest.raises(InputError, match="cannot be read"):
        read_weights(path)
    assert "harm" not in capsys.readouterr().out
