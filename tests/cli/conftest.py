"""What tests of ``jaxpf evaluate`` share."""

import jax
import pytest
from command_line import refusal_of
from small_sequence_folder import write_sequence

from jaxpf.evaluation import report


@pytest.fixture(scope="module")
def started_jax():
    """Too late for --devices to change them for the tests that follow."""
    jax.devices()


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder with a recorded sequence and other trackers' results."""
    folder = tmp_path_factory.mktemp("evaluate")
    write_sequence(folder / "two")
    rows = (folder / "two" / "gt.csv").read_text().replace(",occ", "").splitlines()
    (folder / "theirs.csv").write_text("\n".join(row.removesuffix(",0") for row in rows))
    return folder


@pytest.fixture
def short_report(monkeypatch):
    """A report has tests of its own, and takes seconds."""

    def write(overview):
        (overview.results.folder / "report.html").write_text(
            f"{len(overview.summaries)} configurations"
        )

    monkeypatch.setattr(report, "write_report", write)


@pytest.fixture
def refuse(tmp_path, monkeypatch):
    """Evaluate, and get the one sentence of the refusal; nothing may be left behind."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments):
        sentence = refusal_of("evaluate", *arguments)
        assert not list(tmp_path.iterdir())
        return sentence

    return run
