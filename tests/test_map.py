"""The map in ``jaxpf/__init__`` is true: imports run downwards, and none in a circle."""

import ast
import functools
import graphlib
import re
from pathlib import Path

import jaxpf
from jaxpf.contract.calls import DEFAULTS

ROOT = Path(jaxpf.__file__).parent
#: Rows of the map, the uppermost first: each the rooms that stand on one line.
ROWS = [re.findall(r"``(\w+)/?``", row) for row in re.findall("^``.*", jaxpf.__doc__, re.MULTILINE)]
LEVELS = {room: level for level, row in enumerate(ROWS) for room in row if room != "scenes"}


def name_of(path):
    parts = path.relative_to(ROOT.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {name_of(path): path for path in ROOT.rglob("*.py")}


def imported(tree):
    """Modules of jaxpf that a program imports, wherever, for a type checker alone, too."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name in MODULES)
        if isinstance(node, ast.ImportFrom) and node.module in MODULES:
            every = {f"{node.module}.{alias.name}" for alias in node.names}
            yield from every & MODULES.keys() or {node.module}


@functools.cache
def imports():
    return {
        name: set(imported(ast.parse(path.read_text()))) - {name, "jaxpf"}
        for name, path in MODULES.items()
    }


def room_of(module):
    return module.partition(".")[2].partition(".")[0]


def test_every_room_stands_on_the_map():
    folders = {path.name for path in ROOT.iterdir() if (path / "__init__.py").exists()}
    assert folders <= LEVELS.keys()


def test_imports_run_downwards():
    upwards = {
        (one, other)
        for one, others in imports().items()
        for other in others
        if {room_of(one), room_of(other)} <= LEVELS.keys()
        and LEVELS[room_of(other)] < LEVELS[room_of(one)]
    }
    assert not upwards


def test_no_modules_import_each_other_in_a_circle():
    graphlib.TopologicalSorter(imports()).prepare()


def looked_up(node):
    """The name that ``hasattr`` or ``getattr`` is called with, if it is written out."""
    if isinstance(node, ast.Call) and ast.unparse(node.func) in ("hasattr", "getattr"):
        return getattr(node.args[1], "value", None)
    return None


def test_optional_methods_are_looked_up_in_the_contract_alone():
    found = {
        (name, looked_up(node))
        for name, path in MODULES.items()
        if room_of(name) != "contract"
        for node in ast.walk(ast.parse(path.read_text()))
    }
    assert not {row for row in found if row[1] in DEFAULTS}
