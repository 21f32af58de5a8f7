"""The report and its figures: self-contained, escaped, and the same every time."""

import base64
import math
from html.parser import HTMLParser

import cv2
import numpy as np
import pytest
from csv_rows import rows_of
from made_results import DPS, OTHER, PS, SIR, batch, imported, make, walks

from jaxpf.evaluation.figures import write_figures
from jaxpf.evaluation.report import write_report
from jaxpf.evaluation.summaries import measure_results
from jaxpf.evaluation.tables import printed_tables, write_tables

VOID = {"meta", "img", "br"}


class Page(HTMLParser):
    """Tags that balance, every address that a browser would load, and the text."""

    def __init__(self, source):
        super().__init__()
        self.open, self.tags, self.addresses, self.ids, self.text = [], [], [], set(), []
        self.feed(source)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attributes):
        self.tags.append(tag)
        if tag not in VOID:
            self.open.append(tag)
        for name, value in attributes:
            if name in ("src", "href", "poster", "data", "action", "srcset"):
                self.addresses.append(value)
            if name == "id":
                self.ids.add(value)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text.append(data)


def evaluation(folder):
    """Three filters and another tracker on 7 frames, one object absent in the last ones."""
    truth, boxes = walks(seed=11, runs=8, frames=6, objects=2)
    truth[4:, 1] = math.nan
    confidence = np.linspace(0.1, 1, 8)[:, None, None]
    batches = [
        (SIR, [batch(boxes, distinct_share=1.0, confidence=confidence)]),
        (PS, [batch(boxes[::-1])]),
        (DPS, [batch(truth + 0.3 * (boxes - truth))]),
        (OTHER, [imported(boxes[3])]),
    ]
    return make(folder, batches, truth)


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    results = evaluation(tmp_path_factory.mktemp("report") / "results")
    path = write_report(write_tables(results))
    return results, path.read_text(encoding="utf-8")


def test_the_file_needs_no_other(written):
    page = Page(written[1])
    assert len(page.addresses) > 9
    for address in page.addresses:
        local = address.startswith("data:image/png;base64,")
        assert local or (address[0] == "#" and address[1:] in page.ids), address[:60]
    assert not {"script", "link", "iframe", "object"} & set(page.tags)
    for loads in ("url(", "@import"):
        assert loads not in written[1]
    assert "Content-Security-Policy\" content=\"default-src 'none'" in written[1]
    assert "prefers-color-scheme: dark" in written[1]
    assert '<meta name="color-scheme" content="light dark">' in written[1]


def test_the_users_words_are_escaped(written):
    source = written[1]
    assert "made &lt;scene&gt;" in source
    assert "a|b &lt;i&gt;_100%$x$" in source
    assert "<i>" not in source
    assert "<script" not in source


def test_tables_say_what_the_summary_says(written):
    results, source = written
    page = Page(source)
    text = " ".join("".join(page.text).split())
    for title in ("All objects", "Object 1", "Object 2", "Standard scores", "Settings"):
        assert title in text
    for table in printed_tables(write_tables(results)).values():
        assert all(cell in text for cell in table.to_numpy().flat)
    assert "one track, the same for every seed" in text
    assert {"differences", *FIGURES} <= page.ids


FIGURES = ("calibration", "confidence", "error-over-time", "success-curves")


def test_figures_are_embedded_as_they_are_on_disk(written):
    results, source = written
    paths = sorted((results.folder / "figures").glob("*.png"))
    assert tuple(path.stem for path in paths) == FIGURES
    for path in paths:
        assert base64.b64encode(path.read_bytes()).decode() in source
        assert cv2.imread(str(path)).std() > 5  # something is drawn


@pytest.mark.usefixtures("without_scores")
def test_reports_of_nothing_and_of_one_run_on_one_object_and_frame(tmp_path):
    truth, _ = walks(seed=6, runs=1, frames=6, objects=2)
    results = make(tmp_path / "none", [(SIR, [])], truth, runs=9)
    made = write_tables(results)
    assert printed_tables(made) == {}
    assert rows_of(results.folder / "results.csv") == []
    page = Page(write_report(made).read_text(encoding="utf-8"))
    assert "0 of 9 runs are finished" in "".join(page.text)
    assert "img" not in page.tags
    truth, boxes = walks(seed=12, runs=1, frames=1, objects=1)
    results = make(tmp_path / "one", [(SIR, [batch(boxes)])], truth)
    page = Page(write_report(write_tables(results)).read_text(encoding="utf-8"))
    text = "".join(page.text)
    assert "1 configuration, 1 run each, 1 object (1), 1 frame after the start frame 0" in text
    assert "All objects" not in text
    assert "differences" not in page.ids


@pytest.mark.slow
def test_figures_are_the_same_bytes_every_time(written):
    results, _ = written
    figures = results.folder / "figures"
    before = {path.name: path.read_bytes() for path in figures.iterdir()}
    write_figures(measure_results(results))
    assert {path.name: path.read_bytes() for path in figures.iterdir()} == before
