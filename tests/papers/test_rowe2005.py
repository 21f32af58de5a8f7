"""rowe2005's tables and verdicts on made outcomes; one small measurement of the real thing."""

from contextlib import suppress

import numpy as np
import pytest

import jaxpf
import scenes
from jaxpf.papers import rowe2005
from jaxpf.papers.checkpoints import keeping
from jaxpf.papers.judging import comparison_table
from jaxpf.papers.judging.claims import NOT_SEEN, SUPPORTED, judge_all
from jaxpf.papers.rowe2005 import measures, published, scenes as synthetic, tables
from jaxpf.papers.rowe2005.scenes import Measurement

SCENES, RUNS, FRAMES, TARGETS = 25, synthetic.RUNS_PER_SCENE, 20, 2


def outcome(seed=0, **errors):
    """Runs in which every variant has a mean error of .1, or the one given."""
    rng = np.random.default_rng(seed)
    names = tuple(synthetic.VARIANTS)
    shape = len(names), SCENES, RUNS, FRAMES, TARGETS
    error = 0.1 + 0.01 * rng.standard_normal(shape)
    for name, value in errors.items():
        error[names.index(name)] += value - 0.1
    share = np.full(shape, 0.5)
    share[..., 0] += 0.001 * rng.standard_normal(shape[:-1])
    share[..., 1] = 1 - share[..., 0]
    share[names.index("without eq. 4")] = (1.0, 0.0)
    ratio = 1 + 0.01 * rng.standard_normal(shape)
    ratio[names.index("without size term")] *= 0.2
    astray = 0.01 * rng.random(shape[:-1])
    astray[names.index("neither")] = 0.5
    between = 0.1 + 0.01 * rng.random((len(names), SCENES))
    between[names.index("Condensation")] *= 10
    within = 0.1 + 0.01 * rng.random((len(names), SCENES))
    strip = np.zeros((SCENES, FRAMES, TARGETS), bool)
    strip[:, :5] = True
    return synthetic.Outcome(names, error, ratio, share, astray, between, within, strip)


def verdicts(found, crossing=None):
    measured = rowe2005.PAPER.quantities(Measurement(found, crossing or found))
    return {each.claim.key: each.verdict for each in judge_all("rowe2005", measured)}


def test_the_published_figures_are_those_of_table_1():
    assert published.tracked_mean("neither") == pytest.approx(0.120, abs=5e-4)
    assert published.tracked_mean("both") == pytest.approx(0.087, abs=5e-4)
    assert published.losses("neither") == (2, 8)
    assert published.losses("both") == (0, 8)


def test_what_agrees_with_the_paper_is_supported():
    found = verdicts(outcome(neither=0.15))
    keys = "starves half error samples negligible collapse size_term condensation proposal"
    assert {found[key] for key in keys.split()} == {SUPPORTED}


def test_what_disagrees_is_contradicted():
    found = outcome(neither=0.05, both=0.2)
    assert verdicts(found)["error"] == NOT_SEEN
    kept = found._replace(area_ratio=1 + 0.1 * found.error)
    assert verdicts(kept)["collapse"] == NOT_SEEN
    lost = verdicts(outcome(both=3.0))
    assert lost["never_lost"] == lost["power"] == NOT_SEEN
    steady = found._replace(between=0.01 * found.between)
    assert verdicts(steady)["condensation"] == NOT_SEEN


def test_lost_targets_do_not_count_in_the_tracked_error():
    found = outcome()
    error = found.error.copy()
    error[found.of("both"), :, 0, :, 1] = 5.0
    found = found._replace(error=error)
    assert measures.lost(found, "both").mean() == pytest.approx(1 / (RUNS * TARGETS))
    assert measures.tracked_error(found, "both").mean() == pytest.approx(0.1, abs=0.01)


def test_runs_whose_target_has_no_particles_do_not_vary():
    rng = np.random.default_rng(0)
    places = rng.normal(size=(40, 50, 2, 2))  # two coordinates of variance 1
    areas, counts = np.full((50, 2), 4.0), np.ones((40, 50, 2), bool)
    expected = pytest.approx(np.sqrt(2 / 4), rel=0.05)
    assert synthetic.deviation_between(places, counts, areas) == expected
    places[:20, :, 1] = 1000.0  # starved, and its estimate far away
    counts[:20, :, 1] = False
    assert synthetic.deviation_between(places, counts, areas) == expected
    counts[1:] = False
    assert np.isnan(synthetic.deviation_between(places, counts, areas))


def test_errors_are_told_apart_by_place():
    found = outcome()
    error = np.where(found.in_strip[:, None], 0.4, 0.1) + 0 * found.error
    found = found._replace(error=error)
    np.testing.assert_allclose(measures.error_by_place(found, "both", strip=True), 0.4)
    np.testing.assert_allclose(measures.error_by_place(found, "both", strip=False), 0.1)


def test_tables_have_every_variant():
    found = outcome()
    shares, errors, *others = tables.tables(Measurement(found, found))
    assert [label for label, _ in shares.rows][1] == "with eq. 4"
    assert shares.rows[1][1][0].published == 50
    assert errors.rows[3][1][0].published == pytest.approx(0.087, abs=5e-4)
    assert errors.rows[3][1][0].measured.value == pytest.approx(0.1, abs=0.01)
    sides = {label: cells[0].measured.value for label, cells in others[1].rows}
    assert sides["without size term"] == pytest.approx(np.sqrt(0.2), abs=0.02)


@pytest.mark.slow
def test_the_whole_comparison_is_measured_printed_and_written(tmp_path, monkeypatch):
    """Two short scenes; the figures mean nothing at this length."""
    make = scenes.make
    monkeypatch.setattr(
        scenes, "make", lambda name, **settings: make(name, **settings | {"num_frames": 12})
    )
    with suppress(KeyboardInterrupt), keeping(tmp_path, {}):
        first = rowe2005.PAPER.run(scenes=2, quick=True)
        raise KeyboardInterrupt
    # What was measured before the stop is not measured again.
    monkeypatch.setattr(jaxpf, "monte_carlo", None)
    with keeping(tmp_path, {}):
        found = rowe2005.PAPER.run(scenes=2, quick=True)
    assert [table.texts() for table in found.tables] == [table.texts() for table in first.tables]
    names = [table.name for table in found.tables]
    assert names == [
        "shares",
        "errors",
        "likelihoods",
        "sizes",
        "variance",
        "chosen_settings",
    ]
    assert all(table.texts() for table in found.tables)
    written = comparison_table.write(found, tmp_path)
    assert {"figure_2.png", "figure_4.png", "rowe2005.md"} <= set(written)
    assert "49.5 to 50.5" in (tmp_path / "rowe2005.md").read_text()
