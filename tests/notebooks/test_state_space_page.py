"""The page on state-space models: its code runs as it stands, and its examples are short."""

import ast
import re
from pathlib import Path

import jax
import nbformat
import numpy as np
import pytest

import jaxpf

FOLDER = Path(__file__).resolve().parents[2] / "notebooks"
PAGE = (FOLDER / "docs" / "state_space.md").read_text()
MODEL, COMPONENTS, EXACT, ESTIMATES, NUTS = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
#: The table's calls by name, such as ``jaxpf.smooth(tracker, key, y)``.
CALLS = {
    name: call for call, name in re.findall(r"`(?:\w+, \w+ = )?(jaxpf\.(\w+)\([^`]*\))`", PAGE)
}


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """The names that the page's first block defines, and those that its table supposes."""
    names = {"folder": tmp_path_factory.mktemp("page")}
    exec(MODEL, names)
    names["y"] = np.linspace(-1, 1, 5)
    names["log_prior"] = lambda p: -p["s"]
    return names


def test_stochastic_volatility_takes_ten_lines():
    tree = ast.parse(MODEL)
    model = [x for x in tree.body if not isinstance(x, ast.Import | ast.ImportFrom | ast.Assign)]
    assert sum(x.end_lineno - x.lineno + 1 for x in model) <= 10


def test_a_likelihood_of_the_components_that_are_there_has_an_exact_gradient(page):
    """Particles that all move alike: the evidence is a product of densities."""
    names = dict(page)
    exec(COMPONENTS, names)
    start, y = np.array([1.0, 2.0]), np.random.default_rng(0).normal(size=(4, 2))
    missing = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], bool)

    def evidence(p):
        tracker = jaxpf.state_space(
            initial=start,
            transition=lambda key, x, p: p["a"] * x,
            log_likelihood=names["log_likelihood"],
            parameters=p,
            num_particles=2,
        )
        return jaxpf.log_evidence(jaxpf.run(tracker, jax.random.key(0), frames)[1])

    def exact(p):
        means = p["a"] ** np.arange(1, 5)[:, None] * start
        return jax.scipy.stats.norm.logpdf(y, means, p["noise"])[~missing].sum()

    frames, p = np.ma.masked_array(y, missing), {"a": 0.8, "noise": 0.7}
    found, expected = (jax.value_and_grad(value)(p) for value in (evidence, exact))
    jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, rtol=1e-4), found, expected)


@pytest.mark.slow
def test_the_calls_of_the_table_run(page):
    """Traced alone, which is quick; the notebook runs them all."""
    names = page | {"keys": jax.random.split(page["key"], 3)}
    names["state"], _ = eval(CALLS["run"], names)
    for name in ("smooth", "forecast", "monte_carlo", "pmmh"):
        jax.eval_shape(lambda code=CALLS[name]: eval(code, names))
    eval(CALLS["save"], names | {"path": page["folder"] / "state.npz", "time": 5})
    loaded = eval(CALLS["load"], names | {"path": page["folder"] / "state.npz"})
    np.testing.assert_array_equal(loaded.lagged, names["state"].lagged)


@pytest.mark.slow
def test_parameters_in_three_ways_agree(page):
    pytest.importorskip("blackjax", reason="pip install blackjax")
    rng, hidden, frames = np.random.default_rng(4), 0.0, []
    for _ in range(40):
        hidden = 0.8 * hidden + 0.6 * rng.normal()
        frames.append(hidden + 0.5 * rng.normal())
    names = page | {"y": np.array(frames)}
    for code in (EXACT, ESTIMATES, NUTS):
        exec(code, names)
    for name in "as":
        exact = np.asarray(names["draws"][name])
        ours = np.asarray(names["posterior"].parameters[name])
        assert abs(ours.mean() - exact.mean()) < 0.3 * exact.std()
        assert 0.8 < ours.std() / exact.std() < 1.25
        assert abs(names["tuned"].values[f"parameters.{name}"] - exact.mean()) < 1.5 * exact.std()


def test_each_example_of_page_and_notebook_has_at_most_15_lines_beyond_its_model():
    notebook = nbformat.read(FOLDER / "state_space.ipynb", as_version=4)
    cells = [cell.source for cell in notebook.cells if cell.cell_type == "code"]
    for code in (MODEL, EXACT, ESTIMATES, NUTS, *cells):
        beyond = sum(
            statement.end_lineno - statement.lineno + 1
            for statement in ast.parse(code).body
            if not isinstance(statement, ast.FunctionDef | ast.ClassDef)
        )
        assert beyond <= 15, code
