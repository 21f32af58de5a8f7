"""The site is built without a warning, and every command and every module has a page."""

import html
import importlib
import inspect
import re
import subprocess
import sys
from pathlib import Path

import pytest
from filelock import FileLock

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
    # Pages are first written into one folder of the project: no two workers at the same time.
    with FileLock(tmp_path_factory.getbasetemp().parent / "site.lock"):
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


@pytest.mark.slow
def test_the_reference_is_for_users(site):
    """No path of the build, no sentence that Python writes, no helper, links to the sources."""
    pages = {path.stem: path.read_text() for path in (site / "docs/generated").glob("jaxpf*.html")}
    plain = {name: html.unescape(re.sub("<[^>]*>", "", page)) for name, page in pages.items()}
    for name, text in plain.items():
        for stray in (str(ROOT), "<function", "<module", "<factory>", "new instance of", "_jax."):
            assert stray not in text, (name, stray)
    package = plain["jaxpf"]
    assert "imports from itself" not in package
    assert package.index("jaxpf.state_space(") < package.index("jaxpf.run(")
    assert "viewcode-link" in pages["jaxpf"]
    assert "log_prob_all(" in plain["jaxpf.contract"]  # the method, which users may write
    assert "has_log_joint(" not in plain["jaxpf.contract"]
    assert "masked_mean(" not in plain["jaxpf.measures"]


def test_every_public_name_of_the_package_stands_on_its_page(monkeypatch):
    monkeypatch.syspath_prepend(ROOT / "notebooks" / "docs")
    listed = importlib.import_module("pages")._names(jaxpf)
    public = {name for name in jaxpf.__all__ if not inspect.ismodule(getattr(jaxpf, name))}
    assert sorted(listed) == sorted(public)
