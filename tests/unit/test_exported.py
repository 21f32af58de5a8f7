"""Programs kept on disk: found again, and only where nothing has changed."""

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
    monkeypatch.setattr(exported, "_origin", lambda: b"\0" * 32)
    assert_right(call())
    assert traced == [3]
    assert len(kept(folder)) == 1
    start_anew()
    call()
    assert traced == []


@pytest.mark.parametrize("content", [b"", b"\0" * 10, None], ids=["empty", "cut", "damaged"])
def test_a_damaged_file_is_replaced(folder, content):
    call()
    (path,) = kept(folder)
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2] if content is None else content)
    start_anew()
    assert_right(call())
    assert traced == [3]
    assert path.read_bytes()[:32] == whole[:32]
    start_anew()
    assert_right(call())
    assert traced == []


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


def test_the_sources_decide_the_origin(tmp_path, monkeypatch):
    import scenes

    exported._origin.cache_clear()
    before = exported._origin()
    (tmp_path / "__init__.py").write_text("")
    monkeypatch.setattr(scenes, "__file__", str(tmp_path / "__init__.py"))
    digests = [before]
    for text in ("a = 1\n", "a = 2\n"):
        (tmp_path / "module.py").write_text(text)
        exported._origin.cache_clear()
        digests.append(exported._origin())
    exported._origin.cache_clear()
    assert len(set(digests)) == 3
