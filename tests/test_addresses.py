"""One address for every name: public modules are real ones, and everybody writes their names."""

import ast
import functools
import importlib
import re
import subprocess
import sys
import types
from pathlib import Path

import nbformat
import pytest

import jaxpf

ROOT = Path(__file__).resolve().parents[1]
PUBLIC = [name for name in jaxpf.__all__ if isinstance(getattr(jaxpf, name), types.ModuleType)]
NAMES = [name for name in jaxpf.__all__ if name not in PUBLIC]
TESTS = sorted((ROOT / "tests").rglob("*.py"))
SOURCES = sorted(path for room in ("jaxpf", "scenes") for path in (ROOT / room).rglob("*.py"))
#: What a program or a notebook may name besides: papers, and trackers to compare with.
ROOMS = ("papers",)
MISSING = object()


@functools.cache
def found_at(address):
    """The module or the object at an address; MISSING where there is nothing."""
    try:
        return importlib.import_module(address)
    except ImportError:
        place, _, name = address.rpartition(".")
        return getattr(found_at(place), name, MISSING) if place else MISSING


def names_of(there):
    """A public module's names: those that it lists, or that it defines."""
    defined = (n for n, value in vars(there).items() if home_of(value) == there.__name__)
    return getattr(there, "__all__", None) or [n for n in defined if not n.startswith("_")]


def home_of(value):
    """The module where a function or a class was defined; None of what is neither."""
    return getattr(value, "__module__", None) if callable(value) else None


@functools.cache
def offered():
    """Id of an object -> its public addresses; names and numbers are nobody's."""
    known = {}
    for module in PUBLIC:
        there = importlib.import_module(f"jaxpf.{module}")
        for name in names_of(there):
            value = getattr(there, name)
            if (home_of(value) or "").startswith("jaxpf"):
                known.setdefault(id(value), []).append(f"jaxpf.{module}.{name}")
    for name in NAMES:
        known.setdefault(id(getattr(jaxpf, name)), []).append(f"jaxpf.{name}")
    return known


def better(address):
    """The public addresses of what stands at an address that is not one; [] where it is."""
    names = offered().get(id(found_at(address)), [])
    return [] if address in names else names


def imported(source):
    """Addresses of names of jaxpf that a program imports, or writes out."""
    tree = ast.parse(source)
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "jaxpf":
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
        if isinstance(node, ast.Import):
            yield from (a.name for a in node.names if a.name.split(".")[0] == "jaxpf")


def programs():
    """Name -> code of the README's Python blocks, and of the notebooks."""
    blocks = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)
    found = {f"README {number}": block for number, block in enumerate(blocks, 1)}
    for path in sorted((ROOT / "notebooks").glob("*.ipynb")):
        cells = nbformat.read(path, as_version=4).cells
        code = "\n".join(cell.source for cell in cells if cell.cell_type == "code")
        found[path.stem] = re.sub(r"^[%!].*", "", code, flags=re.MULTILINE)
    return found


@pytest.mark.parametrize("module", PUBLIC)
def test_a_public_module_is_had_in_every_way(module):
    there = importlib.import_module(f"jaxpf.{module}")
    assert getattr(jaxpf, module) is there
    assert there.__name__ == f"jaxpf.{module}"
    assert there.__doc__
    for name in names_of(there):
        program = f"import jaxpf; from jaxpf import {module}; from jaxpf.{module} import {name}"
        exec(f"{program}; assert {module} is jaxpf.{module}; assert {module}.{name} is {name}", {})


def test_importing_the_library_imports_no_jax():
    program = (
        "import sys, jaxpf; assert 'jax' not in sys.modules; assert 'numpy' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", program], check=True)


def test_tests_write_public_addresses():
    wrong = {
        f"{path.relative_to(ROOT)}: {address}": better(address)
        for path in TESTS
        for address in imported(path.read_text())
        if not isinstance(found_at(address), types.ModuleType) and better(address)
    }
    assert not wrong


def test_programs_that_people_read_write_public_addresses():
    rooms = {f"jaxpf.{name}" for name in (*PUBLIC, *ROOMS, *jaxpf.__all__)} | {"jaxpf"}
    wrong = {
        f"{name}: {address}"
        for name, code in programs().items()
        for address in imported(code)
        if ".".join(address.split(".")[:2]) not in rooms or found_at(address) is MISSING
    }
    assert not wrong


def test_what_is_written_as_an_address_is_one():
    """In docstrings, comments and README: ``jaxpf.x.y`` exists, and is the public address."""
    wrong = {}
    texts = {path: path.read_text() for path in [*SOURCES, ROOT / "README.md"]}
    for path, text in texts.items():
        for address in re.findall(r"`(jaxpf(?:\.\w+)+)", text):
            if found_at(address) is MISSING or better(address):
                wrong[f"{path.relative_to(ROOT)}: {address}"] = better(address)
    assert not wrong
