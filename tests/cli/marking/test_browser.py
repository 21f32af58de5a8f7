"""``jaxpf mark`` and ``jaxpf view`` as a person uses them: a mouse in a real browser."""

import json
import shutil
import signal
import subprocess
import sys
import time
import tomllib
from types import SimpleNamespace

import numpy as np
import pytest
from command_line import jaxpf
from csv_rows import rows_of
from films import moving_square, write_film

from jaxpf.cli.shared.flags import write_config
from jaxpf.contours.target import PIECES, OutlineFile

Keys = pytest.importorskip("selenium.webdriver.common.keys").Keys

pytestmark = pytest.mark.slow
_BROWSER = shutil.which("chromium") or shutil.which("chromium-browser")
_DRIVER = shutil.which("chromedriver")
_QUIETLY = (
    "--headless=new --no-sandbox --disable-gpu --disable-quic --no-first-run "
    "--disable-background-networking --disable-component-update --disable-sync "
    "--window-size=1400,900"
)


@pytest.fixture(scope="module")
def browser():
    if not (_BROWSER and _DRIVER):
        pytest.skip("no browser: install chromium and chromium-driver from the system's packages")
    from selenium import webdriver

    options = webdriver.ChromeOptions()
    for argument in _QUIETLY.split():
        options.add_argument(argument)
    options.binary_location = _BROWSER
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    service = webdriver.chrome.service.Service(_DRIVER)
    driver = webdriver.Chrome(options=options, service=service)
    driver.implicitly_wait(20)
    driver.set_script_timeout(200)
    yield driver
    driver.quit()


@pytest.fixture(scope="module")
def street(tmp_path_factory):
    folder = tmp_path_factory.mktemp("page") / "street"
    assert jaxpf("example", "boxes", folder).code == 0
    return folder


class Page:
    """An opened page."""

    def __init__(self, browser, url, process=None):
        self.browser, self.url, self.process = browser, url, process
        browser.set_window_size(1400, 900)
        browser.get(url)
        self.until(lambda: self.canvas.get_attribute("data-shown") != "")

    def one(self, selector):
        return self.browser.find_element("css selector", selector)

    @property
    def canvas(self):
        return self.one("#pictures canvas")

    @property
    def status(self):
        return self.one("#status").text

    def until(self, is_true, seconds=20.0):
        end = time.monotonic() + seconds
        while not is_true():
            assert time.monotonic() < end, self.status
            time.sleep(0.05)

    def mouse(self, *places):
        """Press at the first place, in pixels of the film, move through the others, release."""
        from selenium.webdriver import ActionChains

        actions = ActionChains(self.browser, duration=20)
        for number, (x, y) in enumerate(places):
            offset = self.browser.execute_script(
                "const c = document.querySelector('#pictures canvas');"
                "return [view.x + view.scale * arguments[0] - c.clientWidth / 2,"
                "        view.y + view.scale * arguments[1] - c.clientHeight / 2]",
                x,
                y,
            )
            actions.move_to_element_with_offset(self.canvas, *map(round, offset))
            if number == 0:
                actions.click_and_hold()
        actions.release().perform()

    def keys(self, *keys):
        self.one("body").send_keys(*keys)

    def choose(self, kind):
        self.browser.execute_script(
            "const k = document.getElementById('kind'); k.value = arguments[0]; k.onchange()", kind
        )

    def answer(self, label):
        """Answer a question that the page asks, and forget the refusal before it."""
        button = f"//dialog[@open]/button[text()='{label}']"
        self.browser.find_element("xpath", button).click()
        refused = self.browser.get_log("browser")
        assert refused
        assert all("409" in entry["message"] for entry in refused)

    def rename(self, number, name):
        field = self.browser.find_elements("css selector", "#objects li input[type=text]")[number]
        field.send_keys(Keys.CONTROL + "a")
        field.send_keys(name + "\n")


@pytest.fixture
def opened(browser):
    """Open ``jaxpf mark`` or ``view`` with arguments, in a process of its own."""
    processes = []

    def run(*arguments):
        command = [sys.executable, "-m", "jaxpf", *map(str, arguments), "--no-open"]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        processes.append(process)
        return Page(browser, process.stdout.readline().strip(), process)

    yield run
    wrong = [entry for entry in browser.get_log("browser") if entry["level"] == "SEVERE"]
    browser.get("about:blank")  # a page without its server complains
    for process in processes:
        process.terminate()
        process.wait()
    browser.get_log("browser")
    assert not wrong


def test_from_a_film_to_a_reviewed_and_corrected_track(opened, street, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    starts = tmp_path / "starts.csv"
    page = opened("mark", street / "clip.mp4", "-o", starts)
    page.mouse((120, 80), (150, 100), (160, 170))
    page.mouse((300, 78), (344, 177))
    page.until(lambda: "--boxes" in page.status)
    drawn = [[float(row[key]) for key in "xywh"] for row in rows_of(starts)]
    np.testing.assert_allclose(drawn, [[120, 80, 40, 90], [300, 78, 44, 99]], atol=1)
    page.one("#track").click()
    page.until(lambda: "frames tracked" in page.status, 400)
    output = tmp_path / "jaxpf-clip"
    assert len(rows_of(output / "tracks.csv")) == 2 * 90

    page = opened("view", output)
    page.until(lambda: page.browser.execute_script("return results[0].rows.size") == 90)
    page.keys("n")
    page.until(lambda: "doubtful in frame" in page.status or "lost in frame" in page.status)
    name, frame = page.status.split()[0], int(page.one("#number").get_attribute("value"))
    truth = [row for row in rows_of(street / "truth.csv") if int(row["frame"]) == frame]
    row = next(row for row in rows_of(output / "tracks.csv") if row["id"] == name)
    centre = float(row["x"])
    x, y, w, h = (float(truth[0][key]) for key in "xywh")
    assert frame > 0
    assert centre > 0
    # Draw the object again where it is doubtful.
    page.mouse((x, y), (x + w, y + h))
    corrections, given = output / "corrections-boxes.csv", starts.read_text()
    page.until(corrections.exists)
    page.until(lambda: len(rows_of(corrections)) == 3 and rows_of(corrections)[-1]["id"] == name)
    before = (output / "tracks.csv").read_text()
    page.one("#track").click()
    page.answer("Cancel")
    assert (output / "tracks.csv").read_text() == before
    page.one("#track").click()
    page.answer("Replace the results")
    page.until(lambda: "compiling" in page.status or "frame" in page.status)
    page.until(lambda: "frames tracked" in page.status, 400)
    again = next(
        row
        for row in rows_of(output / "tracks.csv")
        if row["id"] == name and int(row["frame"]) == frame
    )
    assert float(again["x"]) == pytest.approx(x, abs=1)
    assert again["x_2.5"] == ""
    assert starts.read_text() == given


def test_corrections_keep_the_options_and_the_objects_of_a_run(
    opened, street, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    typed = ("--box", "120,80,40,90", "--box", "300,78,44,99", "--start", 1, "-n", 40)
    assert jaxpf("track", street / "clip.mp4", *typed, "--frames", 9, "-o", "run").code == 0
    page = opened("view", "run")
    page.until(lambda: page.browser.execute_script("return results[0].rows.size") == 10)
    page.browser.execute_script(
        "for (const rows of results[0].rows.values()) for (const row of rows) row.doubtful = false;"
        "for (const [n, id] of [[4, '2'], [6, '1']])"
        "  results[0].rows.get(n).find(row => row.id === id).doubtful = true"
    )
    for number, x in (("4", 302), ("6", 124)):
        page.keys("n")
        page.until(lambda at=number: page.canvas.get_attribute("data-shown") == at)
        page.mouse((x, 80), (x + 44, 179))
    drawn = [("1", "1"), ("1", "2"), ("4", "2"), ("6", "1")]
    starts = tmp_path / "run" / "corrections-boxes.csv"
    page.until(starts.exists)
    page.until(lambda: [(row["frame"], row["id"]) for row in rows_of(starts)] == drawn)
    page.one("#track").click()
    page.answer("Replace the results")
    page.until(lambda: "frames tracked" in page.status, 400)
    again = tomllib.loads((tmp_path / "run" / "run.toml").read_text())["track"]
    assert (again["num_particles"], again["start"], again["frames"]) == (40, 1, 9)
    assert "box" not in again
    rows = rows_of(tmp_path / "run" / "tracks.csv")
    assert len(rows) == 2 * 10
    (corrected,) = (row for row in rows if (row["frame"], row["id"]) == ("6", "1"))
    assert float(corrected["x"]) == pytest.approx(124, abs=1)


def test_of_two_tabs_neither_overwrites_the_other_unasked(opened, browser, street, tmp_path):
    starts = tmp_path / "starts.csv"
    page = opened("mark", street / "clip.mp4", "-o", starts)
    first = browser.current_window_handle
    browser.switch_to.new_window("tab")
    other, second = Page(browser, page.url), browser.current_window_handle
    other.mouse((120, 80), (160, 170))
    other.until(lambda: "--boxes" in other.status)
    theirs = starts.read_text()

    browser.switch_to.window(first)
    page.mouse((300, 78), (344, 177))
    page.answer("Load the file")
    page.until(lambda: "is loaded" in page.status)
    assert starts.read_text() == theirs
    page.mouse((200, 50), (240, 90))
    page.until(lambda: starts.exists() and [r["id"] for r in rows_of(starts)] == ["1", "2"])
    ours = [float(row["x"]) for row in rows_of(starts)]
    np.testing.assert_allclose(ours, [120, 200], atol=1)

    browser.switch_to.window(second)
    other.mouse((20, 20), (60, 60))
    other.answer("Replace it by this page")
    other.until(lambda: float(rows_of(starts)[-1]["x"]) == pytest.approx(20, abs=1))
    assert len(rows_of(starts)) == 2
    browser.close()
    browser.switch_to.window(first)


def test_a_run_outlives_its_tab_and_its_page_and_is_found_again(
    opened, browser, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    frames = (moving_square(number // 50, (320, 240)) for number in range(1500))
    write_film(tmp_path / "long.mp4", frames)
    page = opened("mark", "long.mp4")
    page.mouse((4, 8), (20, 120))
    page.until(lambda: "--boxes" in page.status)
    page.one("#track").click()
    page.until(lambda: "Tracking into" in page.status)
    browser.get("about:blank")
    again = Page(browser, page.url)
    again.until(lambda: "Tracking into jaxpf-long:" in again.status)
    again.until((tmp_path / "jaxpf-long" / ".lock").exists, 200)
    browser.get("about:blank")
    page.process.send_signal(signal.SIGINT)
    assert "The run goes on" in page.process.communicate(timeout=60)[0]

    found = opened("mark", "long.mp4")
    found.until(lambda: "Tracking into jaxpf-long:" in found.status)
    found.one("#add").click()
    found.until(lambda: "--boxes" in found.status or "Tracking" in found.status)
    found.until(lambda: "has ended" in found.status, 400)
    assert found.browser.execute_script("return results[0].rows.size") == 1500
    assert json.loads((tmp_path / "jaxpf-long" / "summary.json").read_text())
    # Results are not replaced unasked, though this page has not made them.
    found.one("#track").click()
    found.answer("Cancel")


def test_points_keep_names_that_look_like_markup(opened, street, tmp_path):
    starts = tmp_path / "points.csv"
    page = opened("mark", street / "clip.mp4", "--target", "points", "-o", starts)
    for place in ((60, 60), (200, 100), (300, 150)):
        page.mouse(place)
    page.rename(0, "<b>")
    page.rename(1, "$x$")
    page.keys("z")  # no shortcut
    page.until(
        lambda: starts.exists() and [r["id"] for r in rows_of(starts)] == ["<b>", "$x$", "3"]
    )
    assert not page.browser.find_elements("css selector", "#objects b")
    page.one("#undo").click()
    page.until(lambda: [r["id"] for r in rows_of(starts)] == ["<b>", "2", "3"])


def test_part_trees_and_contours(opened, street, tmp_path):
    parts = tmp_path / "parts.csv"
    page = opened("mark", street / "clip.mp4", "--target", "parts", "-o", parts)
    for place in ((100, 60), (100, 120), (60, 170)):
        page.mouse(place)
    page.mouse((100, 120))  # continue from this joint
    page.mouse((140, 170))
    page.until(lambda: parts.exists() and len(rows_of(parts)) == 3)
    assert [row["parent"] for row in rows_of(parts)] == ["", "1", "1"]
    page.choose("contours")
    for angle in np.linspace(0, 2 * np.pi, 7, endpoint=False):
        page.mouse((300 + 60 * np.cos(angle), 150 + 40 * np.sin(angle)))
    page.keys(Keys.ENTER)
    page.until(lambda: "--contours" in page.status)
    file = street / "clip-contours.json"
    content = json.loads(file.read_text())
    file.unlink()
    assert content["closed"] is True
    points = np.array(content["contours"]["1"])
    np.testing.assert_allclose(points.mean(axis=0), (300, 150), atol=2)


def test_outlines_of_a_run_are_shown(opened, street, tmp_path):
    write_config(
        tmp_path / "run.toml", "track", {"video": street / "clip.mp4", "target": "contours"}
    )
    (tmp_path / "summary.json").write_text("{}")
    (tmp_path / "tracks.csv").write_text("frame,time,id,x,y,lost\n0,0,wire,50,60,0\n")
    line = np.random.default_rng(0).uniform(20, 90, (1, 2 * (PIECES + 1)))
    with OutlineFile(tmp_path / "outlines.csv", SimpleNamespace(ids=["wire"])) as file:
        file(0, line)
    page = opened("view", tmp_path)
    page.until(lambda: page.browser.execute_script("return results[0].outlines.size") == 1)
    shown = page.browser.execute_script("return results[0].outlines.get('0/wire')")
    np.testing.assert_allclose(shown, line.reshape(-1, 2), atol=1e-3)


def test_a_page_is_used_at_any_width_and_by_keys(opened, street, tmp_path):
    page = opened("mark", street / "clip.mp4", "-o", tmp_path / "starts.csv")
    page.browser.set_window_size(600, 800)
    assert page.canvas.size["width"] > 400
    page.keys(Keys.ARROW_RIGHT, Keys.ARROW_RIGHT)
    page.until(lambda: page.canvas.get_attribute("data-shown") == "2")
    page.one("#add").click()
    page.until(lambda: (tmp_path / "starts.csv").exists())
    width = page.one("input[aria-label='w of 1']")
    width.send_keys(Keys.CONTROL + "a")
    width.send_keys("50\n")
    page.until(lambda: float(rows_of(tmp_path / "starts.csv")[0]["w"]) == 50)
    unnamed = page.browser.execute_script(
        "return [...document.querySelectorAll('input, select, button, canvas')].filter("
        "e => !e.textContent.trim() && !e.closest('label') && !e.ariaLabel).length"
    )
    assert unnamed == 0


def test_a_thousand_frames_scroll_fast(opened, tmp_path):
    still = np.random.default_rng(0).integers(0, 255, (480, 640, 3), np.uint8) // 4

    def frame(number):
        still[200:240, number % 600 : number % 600 + 40] = number % 255
        return still.copy()

    write_film(tmp_path / "long.mp4", map(frame, range(1000)))
    page = opened("mark", tmp_path / "long.mp4")
    milliseconds = page.browser.execute_async_script(
        """
        const done = arguments[0], times = [];
        (async () => {
          for (let number = 1; number < 1000; number++) {
            const begin = performance.now();
            go(number);
            await pictures.get(number).decode();
            times.push(performance.now() - begin);
          }
          done(times);
        })();
        """
    )
    assert np.median(milliseconds) < 100
