"""The site is built without a warning, and every command and every module has a page."""

import inspect
import re
import subprocess
import sys
from pathlib import Path

import pytest

import jaxpf
from jaxpf.cli import group

ROOT = Path(__file__).resolve().parents[2]
#: Where a reader finds the answers that the start page promises.
PROMISED = ("start", "howto", "papers", "own", "glossary", "speed", "uncertainty", "proofs")


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    pytest.importorskip("sphinx_book_theme", reason="pip install 'jaxpf[docs]' builds the site")
    folder = tmp_path_factory.mktemp("site")
    build = [sys.executable, "-m", "sphinx", "-qW", "--keep-going", "-c", "notebooks/docs"]
    done = subprocess.run(
        [*build, "notebooks", str(folder)], cwd=ROOT, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr[-3000:]
    return folder


@pytest.mark.slow
def test_every_command_module_and_notebook_has_a_page(site):
    there = {path.stem for path in site.rglob("*.html")}
    subcommands = set(group.list_commands(None)) - {"track", "contour"}
    pages = {f"jaxpf-{name}" for name in subcommands} | {"jaxpf-track-boxes", "jaxpf-contour-learn"}
    modules = (name for name in jaxpf.__all__ if inspect.ismodule(getattr(jaxpf, name)))
    pages |= {f"jaxpf.{name}" for name in modules}
    pages |= {path.stem for path in (ROOT / "notebooks").glob("*.ipynb")}
    assert pages <= there


@pytest.mark.slow
def test_the_start_page_leads_to_what_it_promises(site):
    start = (site / "index.html").read_text()
    for page in PROMISED:
        assert f'href="docs/{page}.html"' in start
    assert "centre_colour" in (site / "docs" / "own.html").read_text()
    assert "weighted standard deviation" in (site / "docs" / "glossary.html").read_text()


@pytest.mark.slow
def test_formulas_need_no_network_and_classes_show_their_arguments(site):
    pages = {path.relative_to(site).as_posix(): path.read_text() for path in site.rglob("*.html")}
    scripts = {
        x for page in pages.values() for x in re.findall(r'<script[^>]* src="([^"]*)"', page)
    }
    assert any("mathjax/" in name for name in scripts)
    assert not [name for name in scripts if "//" in name]
    reference = re.sub("<[^>]*>", "", pages["docs/generated/jaxpf.html"])
    assert "jaxpf.Labelled(dynamics, likelihood, initial, " in reference
    assert "(*_, **options" not in reference
