import csv
import os
import re
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

pytestmark = pytest.mark.compiled_as_by_users

FOLDER = Path(__file__).resolve().parents[2] / "notebooks"
#: Notebook, what its prose says, and a pattern of what a cell prints, any space as one blank.
QUOTED = Path(__file__).with_name("quoted.csv")
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))
# A home or working folder of Linux or macOS, a temporary folder, or a Windows drive.
MACHINE_PATH = re.compile(
    r"(?<![\w.])/(?:home|Users|root|tmp|work|var|private|opt|usr|mnt|srv)/\w|(?<![A-Za-z])[A-Za-z]:\\\\?\w"
)

#: What runs here only if asked for.
MINUTES = {"smith2004", "tuning"}

each_notebook = pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)


def code_cells(path):
    cells = nbformat.read(path, as_version=4).cells
    return [cell for cell in cells if cell.cell_type == "code" and cell.source.strip()]


def without_pictures(node):
    """The notebook's JSON less its base64 pictures, in which any letters may occur."""
    if isinstance(node, dict):
        return {k: without_pictures(v) for k, v in node.items() if not k.startswith("image/")}
    return [without_pictures(item) for item in node] if isinstance(node, list) else node


def unprinted(name, notebook):
    """What the prose of a notebook quotes and no cell prints, or says no more."""

    def joined(texts):
        return re.sub(r"\s+", " ", " ".join(texts))

    prose = joined(cell.source for cell in notebook.cells if cell.cell_type == "markdown")
    outputs = (output for cell in notebook.cells for output in cell.get("outputs", []))
    printed = joined(output.text for output in outputs if output.output_type == "stream")
    with QUOTED.open(newline="") as file:
        rows = [row[1:] for row in csv.reader(file) if row[0] == name]
    return [said for said, shown in rows if said not in prose or not re.search(shown, printed)]


def test_there_are_notebooks():
    assert {"first_steps", "partitioned_sampling", "smith2004"} <= {path.stem for path in NOTEBOOKS}


@each_notebook
def test_the_committed_notebook_was_executed_in_one_go(path):
    counts = [cell.execution_count for cell in code_cells(path)]
    assert counts == list(range(1, len(counts) + 1))


@each_notebook
def test_the_committed_notebook_is_small_with_pictures_and_no_errors(path):
    assert path.stat().st_size < 1e6
    outputs = [output for cell in code_cells(path) for output in cell.outputs]
    assert any("image/png" in output.get("data", {}) for output in outputs)
    assert not [output for output in outputs if output.output_type == "error"]
    warnings = [o.text for o in outputs if o.output_type == "stream" and o.name == "stderr"]
    assert not warnings


@each_notebook
def test_the_committed_notebook_tells_nothing_about_the_machine(path):
    notebook = nbformat.read(path, as_version=4)
    outputs = [without_pictures(cell.get("outputs", [])) for cell in notebook.cells]
    metadata = [notebook.metadata, *(cell.metadata for cell in notebook.cells)]
    found = MACHINE_PATH.search(f"{outputs} {metadata}")
    assert found is None, f"{path.name} holds the path {found and found.group()!r}..."
    assert set(notebook.metadata) <= {"kernelspec", "language_info"}


@each_notebook
def test_the_prose_quotes_what_the_cells_print(path):
    assert unprinted(path.stem, nbformat.read(path, as_version=4)) == []


def test_the_search_for_paths_finds_them():
    for text in ("'/home/me/x.webm'", "(/tmp/a)", "at /Users/me", r"C:\\Users", "/root/x"):
        assert MACHINE_PATH.search(text), text
    for text in ("image/png", "text/plain", "a/home/b", "12/25", "Z^/Z"):
        assert not MACHINE_PATH.search(text), text


@pytest.mark.slow
@each_notebook
def test_the_notebook_runs(path):
    if path.stem in MINUTES and "JAXPF_FULL_NOTEBOOKS" not in os.environ:
        pytest.skip(f"{path.name} compiles for minutes; set JAXPF_FULL_NOTEBOOKS=1 to run it")
    notebook = nbformat.read(path, as_version=4)
    resources = {"metadata": {"path": str(FOLDER)}}
    NotebookClient(notebook, timeout=500, kernel_name="python3", resources=resources).execute()
    if "JAXPF_FULL_NOTEBOOKS" in os.environ or "JAXPF_FULL_NOTEBOOKS" not in path.read_text():
        assert unprinted(path.stem, notebook) == []  # what is quoted is of the full form
