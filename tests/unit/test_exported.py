"""Programs kept on disk: found again, and only where nothing has changed."""

import subprocess
import sys
import tempfile

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxpf import exported
from jaxpf.exported import run_exported
from jaxpf.pytree import pytree_dataclass, static_field

traced = []


def scaled(pair, shift, factor):
    """A program that tells when it is traced."""
    traced.append(factor)
    return {"sum": factor * (pair[0] + pair[1]), "shifted": (pair[0] + shift,)}


@pytree_dataclass
class Holder:
    """A value, and a function as part of the structure."""

    value: jax.Array
    function: object = static_field(default=None)


def held(holder):
    """A program whose argument holds a function."""
    traced.append("held")
    return holder.function(holder.value)


def of_holder(holder):
    """A program whose argument is of a class that this package does not know."""
    traced.append("of_holder")
    return holder.value


def drawn(seed):
    """A program that depends on a setting."""
    traced.append("drawn")
    return {"draw": jax.random.uniform(jax.random.key(seed), (4,))}


def called_back(value):
    """A program that JAX does not export."""
    return jax.pure_callback(lambda x: np.asarray(2 * x), value, value)


@pytest.fixture
def folder(tmp_path):
    """An empty folder for programs, and no memory of earlier ones."""
    before = jax.config.jax_compilation_cache_dir
    jax.config.update("jax_compilation_cache_dir", str(tmp_path))
    start_anew()
    yield tmp_path
    jax.config.update("jax_compilation_cache_dir", before)
    exported._program.cache_clear()


def start_anew():
    """Forget what a new process would not know."""
    traced.clear()
    exported._program.cache_clear()


def call(factor=3, size=4):
    pair = np.arange(size, dtype=np.float32), jnp.ones(size)
    return run_exported(scaled, pair, 2.0, factor=factor)


def kept(folder):
    return sorted(folder.glob("*.traced"))


def assert_right(found, factor=3, size=4):
    np.testing.assert_array_equal(found["sum"], factor * (np.arange(size) + 1))
    np.testing.assert_array_equal(found["shifted"][0], np.arange(size) + 2)


def test_a_program_is_traced_once_per_machine(folder):
    assert_right(call())
    assert traced == [3]
    assert len(kept(folder)) == 1
    start_anew()
    assert_right(call())
    assert_right(call())
    assert traced == []


def test_other_constants_and_shapes_are_other_programs(folder):
    call()
    start_anew()
    assert_right(call(factor=5), factor=5)
    assert_right(call(size=6), size=6)
    assert traced == [5, 3]
    assert len(kept(folder)) == 3


def test_a_program_of_other_sources_is_traced_anew(folder, monkeypatch):
    call()
    start_anew()
    monkeypatch.setattr(exported, "_sources", lambda: b"other")
    assert_right(call())
    assert traced == [3]
    assert len(kept(folder)) == 1
    start_anew()
    call()
    assert traced == []


@pytest.mark.parametrize("damage", ["empty", "cut", "changed"])
def test_a_damaged_file_is_replaced(folder, damage):
    call()
    (path,) = kept(folder)
    whole = path.read_bytes()
    middle = len(whole) // 2
    changed = whole[:middle] + bytes([whole[middle] ^ 1]) + whole[middle + 1 :]
    path.write_bytes({"empty": b"", "cut": whole[:middle], "changed": changed}[damage])
    start_anew()
    assert_right(call())
    assert traced == [3]
    start_anew()
    assert_right(call())
    assert traced == []


def test_another_setting_is_another_program(folder):
    usual = run_exported(drawn, 3)
    start_anew()
    with jax.threefry_partitionable(False):
        other = run_exported(drawn, 3)
    assert traced == ["drawn"]
    assert len(kept(folder)) == 2
    assert not np.array_equal(usual["draw"], other["draw"])


def test_a_class_of_somebody_else_is_traced_in_every_process(folder):
    for _ in range(2):
        start_anew()
        holder = Holder(jnp.ones(3))
        np.testing.assert_array_equal(run_exported(of_holder, holder), np.ones(3))
        run_exported(of_holder, holder)
        assert traced == ["of_holder"]
    assert kept(folder) == []


def test_what_cannot_be_exported_runs_all_the_same(folder):
    np.testing.assert_array_equal(run_exported(called_back, np.float32(2)), 4)
    assert kept(folder) == []


def test_any_number_of_devices_serves():
    """Programs for some of the devices, for one of them, and for all."""
    program = """
import sys
import jax
jax.config.update("jax_num_cpu_devices", 3)
jax.config.update("jax_compilation_cache_dir", sys.argv[1])
from jax.sharding import Mesh, PartitionSpec
import numpy as np
import jaxpf
from jaxpf.exported import run_exported
def shared(values, count):
    mesh, spec = Mesh(np.asarray(jax.local_devices()[:count]), ("d",)), PartitionSpec("d")
    return jax.shard_map(lambda x: 2 * x, mesh=mesh, in_specs=spec, out_specs=spec)(values)
for count in (1, 2, 3):
    for _ in range(2):
        found = run_exported(shared, np.arange(6.0), count=count)
        np.testing.assert_array_equal(found, 2 * np.arange(6.0))
"""
    with tempfile.TemporaryDirectory() as empty:
        for folder in (empty, empty, ""):
            subprocess.run([sys.executable, "-c", program, folder], check=True)


def test_without_a_place_to_write_it_works_all_the_same(folder):
    (folder / "file").write_text("")
    jax.config.update("jax_compilation_cache_dir", str(folder / "file"))
    assert_right(call())
    start_anew()
    jax.config.update("jax_compilation_cache_dir", None)
    assert_right(call())
    assert_right(call())
    assert traced == [3]
    assert kept(folder) == []


def test_a_function_in_the_arguments_is_not_taken_for_another_of_its_name(folder):
    def with_offset(offset):
        return lambda value: value + offset

    for offset in (1.0, 2.0):
        found = run_exported(held, Holder(jnp.zeros(3), with_offset(offset)))
        np.testing.assert_array_equal(found, np.full(3, offset))
    assert traced == ["held", "held"]
    assert kept(folder) == []


def test_the_digest_tells_sources_apart(tmp_path, monkeypatch):
    import scenes

    exported._sources.cache_clear()
    before = exported._sources()
    (tmp_path / "__init__.py").write_text("")
    monkeypatch.setattr(scenes, "__file__", str(tmp_path / "__init__.py"))
    digests = [before]
    for text in ("a = 1\n", "a = 2\n"):
        (tmp_path / "module.py").write_text(text)
        exported._sources.cache_clear()
        digests.append(exported._sources())
    exported._sources.cache_clear()
    assert len(set(digests)) == 3
