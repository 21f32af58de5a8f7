"""What a run says of each object at its end."""

import warnings

import numpy as np
import pandas as pd
import pytest

from jaxpf.cli.tracking.report import object_verdicts, sentences
from jaxpf.media import plotting

FRAMES = np.arange(30)
SURE = np.full(30, 0.9)


def table(confidence=None, lost=0.0):
    x, y, first = FRAMES + 10.0, FRAMES + 20.0, FRAMES == 0
    columns = {"frame": FRAMES, "time": FRAMES / 25, "id": np.full(30, 7), "x": x, "y": y}
    columns["speed"] = np.where(first, np.nan, 35.0)
    columns["lost"] = np.zeros(30) + lost
    for name, centre, above in (("x", x, 3.0), ("y", y, 7.0)):
        columns[f"{name}_2.5"] = np.where(first, np.nan, centre - 2)
        columns[f"{name}_97.5"] = np.where(first, np.nan, centre + above)
    columns |= {} if confidence is None else {"confidence": confidence}
    return pd.DataFrame(columns)


def test_an_object_that_is_followed_throughout_needs_no_advice():
    verdicts = object_verdicts(table(SURE), [7])
    assert verdicts["7"] == {
        "frames": 29,
        "tracked_until": 29,
        "frames_lost": 0,
        "lost": [],
        "interval_width": {"x": 5.0, "y": 9.0},
        "mean_confidence": 0.9,
    }
    assert sentences(verdicts, 120.0, 300) == [
        "Object 7: tracked with a confidence of 0.5 or more to the end (frame 29); "
        "95% interval of the centre: 5 pixels wide along x, 9 along y"
    ]
    verdicts["7"]["interval_width"] = {"x": 163.2, "y": 4.44}
    (line,) = sentences(verdicts, 120.0, 300, "point")
    assert line.endswith("95% interval of the point: 160 pixels wide along x, 4.4 along y")


def test_stretches_in_which_an_object_is_lost_are_those_of_the_table():
    lost = np.isin(FRAMES, [10, 11, 14, *range(25, 30)])
    verdicts = object_verdicts(table(SURE, lost), [7])
    assert verdicts["7"]["tracked_until"] == 9
    assert verdicts["7"]["lost"] == [[10, 11], [14, 14], [25, 29]]
    first, advice = sentences(verdicts, 120.0, 300)
    assert "until frame 9, lost in 8 of 29 frames (10 to 11, 14 and 25 to 29)" in first
    assert advice.startswith("Try: ")
    assert "`jaxpf view`" in advice


def test_without_confidence_nothing_is_called_confident():
    verdicts = object_verdicts(table(), [7])
    assert verdicts["7"]["mean_confidence"] is None
    line, caution = sentences(verdicts, None, 300)
    assert line.startswith("Object 7: tracked to the end")
    assert "no confidence: a misplaced object is not reported as lost" in caution


def test_an_effective_sample_size_near_1_is_said():
    verdicts = object_verdicts(table(SURE), [7])
    *_, line = sentences(verdicts, 1.03, 10)
    assert "stays near 1 (median 1 of 10 particles), so intervals are too narrow" in line
    assert len(sentences(verdicts, 1.0, 1)) == 1  # one particle has no other size


def test_trajectories_shade_what_is_lost_and_have_a_panel_for_each_coordinate():
    figure = plotting.trajectories(table(), ["x", "y"], {"7": [[10, 14]]})
    labels = [axis.get_ylabel() for axis in figure.axes]
    assert labels == ["x (pixels)", "y (pixels)", "speed (pixels/s)"]
    for axis in figure.axes:
        (shade,) = axis.patches
        assert (shade.get_x(), shade.get_width()) == (9.5, 5.0)
    assert len(figure.axes[0].collections) == 1  # the band
    assert len(figure.axes[2].collections) == 0  # no interval is known


@pytest.mark.parametrize("name", ["$\\frac{$", "$x$", "\N{WOMAN}", "_a"])
def test_names_are_drawn_as_they_are(name, tmp_path):
    figure = plotting.trajectories(table().assign(id=name), ["x"], {})
    figure.axes[0].set_title(name)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        plotting.save_figure(figure, tmp_path / "x.png")
    (shown,) = figure.axes[0].get_legend().get_texts()
    assert shown.get_text().strip() == name
    assert not shown.get_parse_math()
