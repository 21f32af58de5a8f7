"""The sentence in which an evaluation ends: what tracks best, and what cannot be distinguished."""

import numpy as np
import pytest
from made_results import DPS, OTHER, PS, SIR, batch, imported, make, value, walks

from jaxpf.evaluation import tables
from jaxpf.evaluation.results import Configuration
from jaxpf.evaluation.summaries import measure_results

pytestmark = pytest.mark.usefixtures("without_scores")


def concluded(folder, batches, truth, **settings):
    overview = measure_results(make(folder / "made", batches, truth, **settings))
    return overview.conclusion, overview.ranking


def conclusion(folder, runs=60, **shrunk):
    """Of SIR and others, whose errors are those of SIR times a factor, with noise of their own."""
    truth, boxes = walks(seed=3, runs=runs, frames=12, objects=2)
    configurations = {"sir": SIR, "ps": PS, "dps": DPS}
    batches = []
    for number, (name, factor) in enumerate(shrunk.items()):
        noise = np.random.default_rng(number).normal(0, 0.3, boxes.shape)
        batches.append((configurations[name], [batch(truth + factor * (boxes - truth) + noise)]))
    return concluded(folder, batches, truth)


def test_the_best_is_named_with_its_interval_over_the_first(tmp_path):
    sentence, ranking = conclusion(tmp_path, sir=1.0, ps=0.9, dps=0.1)
    assert ranking == [2, 1, 0]
    assert sentence.startswith("DPS shifts tracks best: success AUC +.")
    assert "] over SIR, and better than PS 21." in sentence


@pytest.mark.parametrize(("runs", "named"), [(9, "9 runs"), (1, "one run")])
def test_fewer_than_ten_runs_are_a_preview(tmp_path, runs, named):
    sentence, ranking = conclusion(tmp_path, runs, sir=1.0, dps=0.1)
    assert sentence.startswith(f"Preview of {named}: DPS shifts is ahead, success AUC .")
    assert sentence.endswith("; fewer than 10 runs decide nothing.")
    assert ranking == [1, 0]


def test_methods_are_compared_at_the_settings_of_the_best(tmp_path):
    """PS beats SIR by a little with each sharpness, and 30 beats 20 by far."""
    truth, boxes = walks(seed=3, runs=60, frames=12, objects=2)
    batches = []
    for sharpness, factor in ((20.0, 1.0), (30.0, 0.1)):
        for method, gain in (("SIR", 1.0), ("PS", 0.5)):
            configuration = Configuration(method, "", {"sharpness": sharpness})
            batches.append((configuration, [batch(truth + gain * factor * (boxes - truth))]))
    grid = {"sharpness": [20.0, 30.0]}
    sentence, ranking = concluded(tmp_path, batches, truth, grid=grid)
    assert ranking == [3, 2, 1, 0]
    start = "With sharpness 30, where the mean is highest, PS tracks best: success AUC +."
    assert sentence.startswith(start)
    assert sentence.endswith("] over SIR.")
    # A single method leaves only settings to compare.
    sentence, _ = concluded(tmp_path / "s", batches[::2], truth, grid=grid)
    assert sentence.startswith("SIR, sharpness 30 tracks best: success AUC +.")
    assert sentence.endswith("] over SIR, sharpness 20.")


def test_equal_methods_cannot_be_told_apart_from_the_best(tmp_path):
    sentence, _ = conclusion(tmp_path, sir=1.0, ps=0.1, dps=0.1)
    assert "tracks best" in sentence
    assert " over SIR; " in sentence
    assert sentence.endswith(" cannot be distinguished from it.")


def test_without_a_difference_none_is_called_best(tmp_path):
    sentence, ranking = conclusion(tmp_path, sir=0.5, ps=0.5, dps=0.5)
    assert sentence.startswith("No configuration tracks best")
    assert len(ranking) == 3


@pytest.mark.statistical
@pytest.mark.slow
def test_a_best_among_equals_is_rarely_claimed(tmp_path):
    """Six equal configurations: at most 5% of the evaluations may claim a difference."""
    claims, repetitions = 0, 20
    for repetition in range(repetitions):
        truth, _ = walks(seed=5, runs=1, frames=3, objects=1)
        batches = [
            (Configuration("SIR", f"{i}"), [batch(walks(100 * repetition + i, 12, 3, 1)[1])])
            for i in range(6)
        ]
        sentence, _ = concluded(tmp_path / f"{repetition}", batches, truth)
        claims += "tracks best" in sentence.replace("No configuration t", "")
    assert claims / repetitions < 0.05 + 4.5 * np.sqrt(0.05 * 0.95 / repetitions)


def test_an_imported_track_is_compared_with_every_run(tmp_path):
    truth, boxes = walks(seed=3, runs=60, frames=12, objects=2)
    batches = [(SIR, [batch(boxes)]), (OTHER, [imported(truth)])]
    sentence, _ = concluded(tmp_path, batches, truth)
    assert sentence.startswith(f"{OTHER.method} tracks best: success AUC +.")


def test_one_screen_shows_the_best_first(tmp_path, monkeypatch):
    monkeypatch.setattr(tables, "MOST_PRINTED", 2)
    truth, boxes = walks(seed=3, runs=3, frames=4, objects=2)
    batches = [
        (Configuration("SIR", f"{i}"), [batch(truth + (boxes - truth) / (1 + i))]) for i in range(4)
    ]
    results = make(tmp_path / "made", batches, truth)
    measured = measure_results(results)
    (table,) = tables.printed_tables(measured).values()
    areas = [value(measured, i, "success_auc") for i in measured.ranking]
    assert areas == sorted(areas, reverse=True)
    best = [measured.names[i] for i in measured.ranking[:2]]
    assert table.method.tolist() == best
