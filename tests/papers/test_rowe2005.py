"""rowe2005's tables and verdicts on made outcomes; one small measurement of the real thing."""

from contextlib import suppress

import jax
import numpy as np
import pytest
from judged import verdicts

import jaxpf
import scenes
from jaxpf.papers.checkpoints import keeping
from jaxpf.papers.judging.claims import NOT_SEEN, SUPPORTED
from jaxpf.papers.rowe2005 import scenes as synthetic, study
from jaxpf.papers.rowe2005.study import PAPER

SCENES, RUNS, FRAMES, TARGETS = 25, synthetic.RUNS_PER_SCENE, 20, 2


def made(**errors):
    """Runs in which every variant has a mean error of .1, or the one given."""
    rng = np.random.default_rng(0)
    shape = SCENES, RUNS, FRAMES, TARGETS
    strip = np.zeros((SCENES, FRAMES, TARGETS), bool)
    strip[:, :5] = True

    def runs(name):
        share = 0.5 + 0.001 * rng.standard_normal(shape[:-1])
        return {
            "error": errors.get(name, 0.1) + 0.01 * rng.standard_normal(shape),
            "share": np.stack([share, 1 - share], axis=-1),
            "area_ratio": 1 + 0.01 * rng.standard_normal(shape),
            "astray": 0.01 * rng.random(shape[:-1]),
            "between": 0.1 + 0.01 * rng.random(SCENES),
            "within": 0.1 + 0.01 * rng.random(SCENES),
            "in_strip": strip,
        }

    found = {name: runs(name) for name in synthetic.VARIANTS}
    found["without eq. 4"]["share"][:] = 1.0, 0.0
    found["without size term"]["area_ratio"] *= 0.2
    found["neither"]["astray"][:] = 0.5
    found["Condensation"]["between"] *= 10
    return found


def judged(found):
    return verdicts(PAPER, studied(found))


def studied(found, stability=2.0):
    spread = 0.01 * np.random.default_rng(1).standard_normal(SCENES)
    return study.study_of(found, found, stability + spread)


def test_the_published_figures_are_those_of_table_1():
    """Errors of both targets in four runs; those above 1 are of lost targets."""
    neither = np.array([0.1163, 0.1309, 3.8864, 0.1182, 0.1222, 0.1226, 0.1101, 2.4679])
    both = np.array([0.0715, 0.0716, 0.0849, 0.1163, 0.0987, 0.1289, 0.0645, 0.0595])
    (table,) = (each for each in PAPER.declared["tables"] if each["name"] == "errors")
    error, lost = (table["published"][name] for name in ("error, tracked targets", "targets lost"))
    for name, errors in (("neither", neither), ("both", both)):
        kept = errors < study.LOST
        assert error[name] == pytest.approx(errors[kept].mean())
        assert lost[name] == 100 * (1 - kept.mean())


def test_claims_follow_what_was_measured():
    found = judged(made(neither=0.15))
    keys = "starves half error samples negligible size_term proposal two_modes"
    assert {found[key] for key in keys.split()} == {SUPPORTED}
    other = made(neither=0.05, both=0.2)
    other["without size term"]["area_ratio"] += 1
    turned = verdicts(PAPER, studied(other, stability=0.5))
    assert turned["error"] == turned["size_term"] == turned["two_modes"] == NOT_SEEN
    lost = judged(made(both=3.0))
    assert lost["never_lost"] == lost["power"] == NOT_SEEN


def test_errors_are_told_apart_by_loss_and_by_place():
    runs = made()["both"]
    runs["error"][:, 0, :, 1] = 5.0
    found = study.measures(runs)
    assert found["lost"].mean() == pytest.approx(1 / (RUNS * TARGETS))
    assert found["error"].mean() == pytest.approx(0.1, abs=0.01)
    runs["error"] = np.where(runs["in_strip"][:, None], 0.4, 0.1) + 0 * runs["error"]
    found = study.measures(runs)
    np.testing.assert_allclose(found["error at a strip"], 0.4)
    np.testing.assert_allclose(found["error elsewhere"], 0.1)


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


def test_runs_differ_more_than_a_run_over_time():
    rng = np.random.default_rng(0)
    levels = 2 * rng.normal(size=(400, 1)) + 0.5 * rng.normal(size=(400, 300))
    assert synthetic.between_over_within(levels) == pytest.approx(np.sqrt(4 + 0.25) / 0.5, rel=0.1)
    assert synthetic.between_over_within(levels.T) < 0.3


def test_condensation_keeps_one_of_two_equal_modes():
    expectations = np.asarray(
        synthetic._expectations(jax.random.split(jax.random.key(0), synthetic.RUNS))
    )
    assert abs(expectations[:, 0].mean()) < 0.2, "both modes have particles at first"
    last = expectations[:, -1]
    assert (abs(last) > 0.9).mean() > 0.7
    assert last.min() < -0.9 < 0.9 < last.max(), "runs differ by the mode that is left"


def test_tables_have_every_variant():
    found = made()
    shares, errors, _, sizes, _ = PAPER.tables(studied(found))
    assert [label for label, _ in shares.rows][1] == "with eq. 4"
    assert shares.rows[1][1][0].published == 50
    assert shares.rows[0][1][3] == "100.0 to 100.0"
    assert errors.rows[3][1][0].published == pytest.approx(0.087, abs=5e-4)
    assert errors.rows[3][1][0].measured.value == pytest.approx(0.1, abs=0.01)
    sides = {label: cells[0].measured.value for label, cells in sizes.rows}
    assert sides["without size term"] == pytest.approx(np.sqrt(0.2), abs=0.02)


@pytest.mark.slow
def test_the_whole_comparison_is_measured_printed_and_written(tmp_path, monkeypatch):
    """Two short scenes; the figures mean nothing at this length."""
    make = scenes.make
    monkeypatch.setattr(
        scenes, "make", lambda name, **settings: make(name, **settings | {"num_frames": 12})
    )
    with suppress(KeyboardInterrupt), keeping(tmp_path, {}) as measurements:
        first = PAPER.compare(range(2), True, measurements)
        raise KeyboardInterrupt
    # What was measured before the stop is not measured again.
    monkeypatch.setattr(jaxpf, "monte_carlo", None)
    with keeping(tmp_path, {}) as measurements:
        found = PAPER.compare(range(2), True, measurements)
    assert [table.texts() for table in found.tables] == [table.texts() for table in first.tables]
    names = [table.name for table in found.tables]
    assert names == ["shares", "errors", "likelihoods", "sizes", "variance", "chosen_settings"]
    written = found.write(tmp_path)
    assert {"figure_2.png", "figure_4.png", "rowe2005.md"} <= set(written)
    assert "49.5 to 50.5" in (tmp_path / "rowe2005.md").read_text()
