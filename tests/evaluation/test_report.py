"""The report and its figures: self-contained, escaped, playable, and the same every time."""

import base64
import math
import re
import shutil
from html.parser import HTMLParser
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from made_results import DPS, OTHER, PARAMETERS, PS, SIR, batch, imported, make, walks

from jaxpf.evaluation import Configuration, Results
from jaxpf.evaluation.collection import ShownRun
from jaxpf.evaluation.output import charts, figures, report
from jaxpf.evaluation.output.clips import make_clip, read_pictures
from jaxpf.evaluation.output.figures import write_figures
from jaxpf.evaluation.output.report import write_report
from jaxpf.evaluation.output.tables import write_tables
from jaxpf.evaluation.results import OWN
from jaxpf.targets import find_adapter
from jaxpf.targets.target import Start

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


def evaluation(folder, frames=True):
    """Three filters and another tracker on 7 frames, one object absent in the last ones."""
    truth, boxes = walks(seed=11, runs=8, frames=6, objects=2)
    truth[4:, 1] = math.nan
    pictures = np.random.default_rng(0).integers(0, 255, (7, 90, 120, 3)).astype(np.uint8)
    batches = [
        (SIR, [batch(boxes, uniqueness=1.0)]),
        (PS, [batch(boxes[::-1])]),
        (DPS, [batch(truth + 0.3 * (boxes - truth))]),
        (OTHER, [imported(boxes[3])]),
    ]
    return make(folder, batches, truth, frames=pictures if frames else None)


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    results = evaluation(tmp_path_factory.mktemp("report") / "results")
    path = write_report(results)
    return results, path.read_text(encoding="utf-8")


def clips_of(source):
    return [
        base64.b64decode(data)
        for data in re.findall(r'src="data:video/webm;base64,([A-Za-z0-9+/=]+)"', source)
    ]


def decoded(data, folder):
    path = folder / "clip.webm"
    path.write_bytes(data)
    capture, frames = cv2.VideoCapture(str(path)), []
    while True:
        read, frame = capture.read()
        if not read:
            return frames
        frames.append(cv2.cvtColor(frame, cv2.COLOR_BGR2RGB))


def test_the_file_needs_no_other(written):
    page = Page(written[1])
    assert len(page.addresses) > 10
    for address in page.addresses:
        local = address.startswith(("data:image/png;base64,", "data:video/webm;base64,"))
        assert local or (address[0] == "#" and address[1:] in page.ids), address[:60]
    assert not {"script", "link", "iframe", "object"} & set(page.tags)
    assert "url(" not in written[1]
    assert "@import" not in written[1]
    policy = re.search(r'Content-Security-Policy" content="([^"]*)"', written[1])
    assert policy is not None
    assert policy[1].startswith("default-src 'none'")


def test_the_users_words_are_escaped(written):
    source = written[1]
    assert "made &lt;scene&gt;" in source
    assert "a|b &lt;i&gt;_100%$x$" in source
    assert "<i>" not in source
    assert "<script" not in source


def test_light_and_dark(written):
    assert "prefers-color-scheme: dark" in written[1]
    assert '<meta name="color-scheme" content="light dark">' in written[1]


def test_tables_say_what_the_summary_says(written):
    results, source = written
    page = Page(source)
    text = " ".join("".join(page.text).split())
    for title in ("All objects", "Object 1", "Object 2", "Standard scores", "Settings"):
        assert title in text
    made = write_tables(results)
    for table in made.printed:
        for row in table.rows:
            for cell in row:
                assert cell in text
    assert "one track, the same for every seed" in text
    for name in (
        "overlaps",
        "rates",
        "differences",
        "diversity",
        "calibration",
        "error-over-time",
        "success-curves",
    ):
        assert name in page.ids


def test_figures_are_embedded_as_they_are_on_disk(written):
    results, source = written
    paths = sorted((results.folder / "figures").glob("*.png"))
    assert [path.stem for path in paths] == [
        *("calibration", "differences", "diversity", "error-over-time-all"),
        f"error-over-time-object-{1 + write_tables(results).hardest}",
        *("overlaps", "rates", "success-curves"),
    ]
    for path in paths:
        assert base64.b64encode(path.read_bytes()).decode() in source
        assert path.with_suffix(".pdf").read_bytes().startswith(b"%PDF")
        assert cv2.imread(str(path)).std() > 5  # something is drawn


def test_a_tracker_that_tells_no_noise_has_bars_without_labels(tmp_path):
    truth, boxes = walks(0, 4, 6, 2)
    own = Configuration("mine", kind=OWN)
    made = make(tmp_path / "own", [(SIR, [batch(boxes)]), (own, [batch(boxes)])], truth)
    tables = write_tables(made)
    figure = charts.diversity(made.object_ids, tables.summaries)
    labels = [text.get_text() for axis in figure.axes for text in axis.texts]
    assert "nan" not in labels
    assert "" in labels
    # The curves' legend lies below them.
    figure = charts.success_curves(made, tables.summaries, [0])
    figure.draw_without_rendering()
    (axis,) = figure.axes
    assert axis.get_legend().get_window_extent().y1 < axis.get_window_extent().y0


def test_clips_play_the_runs_they_name(written, tmp_path):
    results, source = written
    clips = clips_of(source)
    shown = [run for summary in write_tables(results).summaries for run in summary.shown]
    assert len(clips) == len(shown) == 3 + 3 + 3 + 1
    roles = re.findall(r"<figcaption>(Best|Median|Worst|Only) \(run (\d+)\)", source)
    assert roles == [(run.role.capitalize(), f"{run.run}") for run in shown]
    for data in (clips[0], clips[-1]):
        frames = decoded(data, tmp_path)
        assert len(frames) == 6
        assert frames[0].shape == (300, 400, 3)


def one_box(truth):
    """The target and the start of one object."""
    return find_adapter("boxes"), Start(np.array([1]), truth[0], truth[0, :, 2:], (-1,))


def test_a_clip_shows_truth_and_estimate_where_they_are(tmp_path):
    """Black frames of 100 x 50, shown four times as large."""
    frames = np.zeros((3, 50, 100, 3), np.uint8)
    truth = np.array([[[10.0, 10, 20, 20]]] * 3)
    boxes = np.array([[[60.0, 20, 20, 20]]] * 3)
    shown = ShownRun("best", 0, 0.0, boxes, np.zeros((3, 1), bool))
    clip = make_clip(read_pictures(frames), truth, shown, *one_box(truth), 4, fps=25.0)
    assert (clip.width, clip.height, clip.step) == (400, 200, 1)
    assert clip.rate == 4
    picture = decoded(clip.data, tmp_path)[1].astype(int)
    assert picture[80, 38:43].max() > 150  # the left side of the truth, x = 4 * 10
    orange = picture[120, 238:243]
    assert orange[:, 0].max() > 150 > 60 > orange[:, 2].min()
    assert picture[150:, :100].max() > 150  # the number of the frame
    assert picture[100:150, 150:220].max() < 60


def test_long_and_large_scenes_make_short_and_small_clips(tmp_path):
    frames = np.zeros((130, 60, 900, 3), np.uint8)
    boxes = np.broadcast_to([10.0, 10, 100, 20], (130, 1, 4))
    shown = ShownRun("best", 0, 1.0, boxes, np.zeros((130, 1), bool))
    clip = make_clip(read_pictures(frames, (300, 25)), boxes, shown, *one_box(boxes), 1, 30.0)
    assert (clip.width, clip.height, clip.step) == (300, 20, 6)
    assert len(decoded(clip.data, tmp_path)) == 22


def test_the_report_stays_small(tmp_path, monkeypatch):
    results = evaluation(tmp_path / "results")
    monkeypatch.setattr(report, "CLIP_BYTES", 1)
    monkeypatch.setattr(report, "write_figures", lambda *_: [])
    source = write_report(results).read_text(encoding="utf-8")
    Page(source)
    clips = clips_of(source)
    assert len(clips) == 3  # of the first configuration, as small as they get
    assert decoded(clips[0], tmp_path)[0].shape[1] == 300
    assert "Shown are 1 of 4" in source


def test_without_its_scene_a_report_has_no_clips(tmp_path, monkeypatch):
    monkeypatch.setattr(report, "write_figures", lambda *_: [])
    results = evaluation(tmp_path / "results", frames=False)
    source = write_report(results).read_text(encoding="utf-8")
    Page(source)
    assert clips_of(source) == []
    assert "Without clips: the results" in source

    changed = evaluation(tmp_path / "changed")
    shorter = SimpleNamespace(frames=np.zeros((3, 4, 4, 3), np.uint8))
    changed = Results(
        changed.folder, changed.settings, changed.truth, changed.start, lambda: shorter
    )
    assert "Without clips: the scene has changed" in write_report(changed).read_text("utf-8")


def test_a_report_of_nothing(tmp_path):
    truth, _ = walks(seed=6, runs=1, frames=6, objects=2)
    results = make(tmp_path / "results", [(SIR, [])], truth, runs=9)
    source = write_report(results).read_text(encoding="utf-8")
    page = Page(source)
    assert "0 of 9 runs are finished" in "".join(page.text)
    assert "img" not in page.tags


def test_one_run_of_one_configuration_on_one_object_and_frame(tmp_path):
    truth, boxes = walks(seed=12, runs=1, frames=1, objects=1)
    pictures = np.zeros((2, 40, 60, 3), np.uint8)
    results = make(tmp_path / "results", [(SIR, [batch(boxes)])], truth, frames=pictures)
    source = write_report(results).read_text(encoding="utf-8")
    page = Page(source)
    text = "".join(page.text)
    assert "1 configuration, 1 run each, 1 object, 1 frame after the start frame" in text
    assert "All objects" not in text
    assert "differences" not in page.ids
    assert len(clips_of(source)) == 1


def test_figures_are_the_same_bytes_every_time(written, tmp_path, monkeypatch):
    results = written[0]
    save = figures.save

    def save_two(figure, path):
        if path.stem in ("rates", "success-curves"):
            save(figure, path)

    monkeypatch.setattr(figures, "save", save_two)
    shutil.copytree(results.folder / "batches", tmp_path / "batches")
    again = Results(tmp_path, results.settings, results.truth, results.start)
    write_figures(again, write_tables(again))
    names = sorted(path.name for path in (tmp_path / "figures").iterdir())
    assert len(names) == 4
    for name in names:
        found, expected = (folder / "figures" / name for folder in (tmp_path, results.folder))
        assert found.read_bytes() == expected.read_bytes()


@pytest.mark.slow
def test_forty_configurations(tmp_path, monkeypatch):
    """Figures stay of a size that can be looked at, and the clips of one that can be sent."""
    sizes = {}

    def draw(figure, path):
        figure.draw_without_rendering()
        sizes[path.stem] = figure.get_size_inches()

    monkeypatch.setattr(figures, "save", draw)
    truth, boxes = walks(seed=13, runs=3, frames=6, objects=2)
    batches = [
        (Configuration(method, order, {**PARAMETERS, "sharpness": sharpness}), [batch(boxes)])
        for sharpness in (10.0, 20.0, 30.0, 40.0, 50.0)
        for method, order in [("SIR", ""), *(("PS", f"{i}") for i in range(6)), ("DPS", "shifts")]
    ]
    pictures = np.zeros((7, 40, 60, 3), np.uint8)
    results = make(tmp_path / "results", batches, truth, frames=pictures)
    write_figures(results, write_tables(results))
    assert len(sizes) == 8
    for name, (width, height) in sizes.items():
        assert width < 16, name
        assert height < 18, name

    monkeypatch.setattr(report, "write_figures", lambda *_: [])
    source = write_report(results).read_text(encoding="utf-8")
    shown = re.findall(r"<h3>(SIR|PS|DPS)", source[source.index('id="clips"') :])
    assert len(shown) <= 4
    assert f"Shown are {len(shown)} of 40 configurations" in source
    assert set(shown) == {"SIR", "PS", "DPS"}
