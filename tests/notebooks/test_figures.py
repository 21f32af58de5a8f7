"""Figures of README and pages are those that are stored, and README's links lead somewhere."""

import importlib
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
README = (ROOT / "README.md").read_text()


@pytest.fixture
def figures(monkeypatch):
    monkeypatch.syspath_prepend(ROOT / "notebooks" / "docs")
    return importlib.import_module("figures")


def test_every_figure_is_the_stored_one(figures):
    changed = [page.name for page in figures.PAGES if figures.filled(page) != page.read_text()]
    assert not changed, "run `python notebooks/docs/figures.py`"
    marked = figures.MARKED.findall("".join(page.read_text() for page in figures.PAGES))
    assert set(figures.SOURCES["blocks"]) <= dict(marked).keys()


def test_another_figure_is_replaced(figures, tmp_path):
    page = tmp_path / "page.md"
    page.write_text("IoU <!-- test; overlap: jaxpf minus; CSRT -->9<!-- / --> and <!-- former -->")
    expected = "+0.018 [-0.051, 0.087]"
    assert figures.filled(page) == page.read_text().replace("9", expected)


def test_no_mark_ends_a_paragraph(figures):
    """A line that begins with a comment is no text to Markdown, unless it is all comment."""
    for page in figures.PAGES:
        for line in page.read_text().splitlines():
            assert not line.startswith("<!--") or re.fullmatch("<!-- [^>]+ -->", line), page


def test_readme_stays_short():
    assert len(re.sub("<!--.*?-->", "", README).split()) <= 900


def anchors(page):
    """Anchors of a page's headings, as GitHub and the site make them."""
    headings = re.findall(r"^#+ (.*)", page.read_text(), re.M)
    return {re.sub(r"[^\w -]", "", each.lower()).replace(" ", "-") for each in headings}


def test_links_of_readme_lead_to_files_and_headings():
    for name, _, anchor in re.findall(r"\]\((?!https?:)([^)#]+)(#([^)]*))?\)", README):
        assert (ROOT / name).is_file(), name
        assert not anchor or anchor in anchors(ROOT / name), f"{name}#{anchor}"
