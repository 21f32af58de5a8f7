import os
import signal
import subprocess
import sys

import pytest
from refusals import message_of

from jaxpf.files.store import LOCK, locked
from jaxpf.files.writing import LineWriter, atomic_write, prepare_output_folder


def test_a_file_appears_only_when_complete(tmp_path):
    path = tmp_path / "summary.json"
    with atomic_write(path) as file:
        file.write("größe\n")
        assert not path.exists()
    assert path.read_bytes() == "größe\n".encode()
    with atomic_write(path, "wb") as file:
        file.write(b"\x00")
    assert path.read_bytes() == b"\x00"
    assert os.listdir(tmp_path) == ["summary.json"]


def test_writes_of_one_file_that_meet_do_not_disturb_each_other(tmp_path):
    path = tmp_path / "start.csv"
    with atomic_write(path) as first:
        first.write("first")
        with atomic_write(path) as second:
            second.write("second")
        assert path.read_text() == "second"
    assert path.read_text() == "first"
    assert os.listdir(tmp_path) == ["start.csv"]


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt])
def test_a_failed_write_leaves_the_old_file_and_nothing_else(tmp_path, error):
    def fail():
        with atomic_write(path) as file:
            file.write("new")
            raise error

    path = tmp_path / "summary.json"
    path.write_text("old")
    with pytest.raises(error):
        fail()
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["summary.json"]


def test_a_file_that_cannot_be_written_is_named(tmp_path):
    def write(path):
        with atomic_write(path):
            pass

    (tmp_path / "file").touch()
    for call in (write, LineWriter):
        for place in (tmp_path / "gone" / "a.json", tmp_path / "file" / "a.json"):
            assert f"'{place}'" in message_of(call, place)


def test_an_output_folder_is_created_or_reused_and_mixed_only_on_request(tmp_path):
    folder = prepare_output_folder(tmp_path / "a" / "b")
    assert prepare_output_folder(folder) == folder
    assert os.listdir(folder) == []
    (folder / "tracks.txt").write_text("old")
    message = message_of(prepare_output_folder, folder)
    for named in (f"'{folder}'", "'tracks.txt'", "--overwrite"):
        assert named in message
    assert prepare_output_folder(folder, overwrite=True) == folder
    assert (folder / "tracks.txt").read_text() == "old"


def test_an_output_folder_that_is_a_file_or_cannot_be_made_is_named(tmp_path, monkeypatch):
    (tmp_path / "file").touch()
    for place in (tmp_path / "file", tmp_path / "file" / "sub"):
        assert f"'{place}'" in message_of(prepare_output_folder, place)

    def refuse(self):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("pathlib.Path.touch", refuse)
    assert "permission denied" in message_of(prepare_output_folder, tmp_path / "new")


def test_a_line_writers_file_is_whole_after_every_call(tmp_path):
    path = tmp_path / "tracks.csv"
    with LineWriter(path) as writer:
        assert path.read_bytes() == b""
        writer.write_rows([["frame", "id"], [0, "a,b"]])
        assert path.read_text() == 'frame,id\n0,"a,b"\n'
        writer.write_rows([])


@pytest.mark.skipif(sys.platform == "win32", reason="needs SIGKILL")
def test_a_killed_program_leaves_whole_lines(tmp_path):
    program = (
        "import itertools; from jaxpf.files.writing import LineWriter\n"
        "with LineWriter('tracks.csv') as writer:\n"
        "    for frame in itertools.count():\n"
        "        writer.write_rows([[frame, 'left'], [frame, 'right']])\n"
        "        if frame == 100: print('running', flush=True)\n"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", program], cwd=tmp_path, stdout=subprocess.PIPE
    )
    assert process.stdout.readline() == b"running\n"
    process.send_signal(signal.SIGKILL)
    process.wait()
    process.stdout.close()
    text = (tmp_path / "tracks.csv").read_text()
    assert text.endswith(",right\n")
    assert text.count("\n") >= 200


@pytest.mark.skipif(sys.platform == "win32", reason="file size limits are POSIX")
def test_a_full_disk_is_reported_and_the_last_line_is_whole(tmp_path):
    program = (
        "import resource; from jaxpf.files.writing import LineWriter\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))\n"
        "with LineWriter('tracks.csv') as writer:\n"
        "    for frame in range(99): writer.write_rows([[frame, 'a name of some length']])\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True, timeout=500
    )
    assert "InputError: cannot write 'tracks.csv': file too large; check" in done.stderr
    text = (tmp_path / "tracks.csv").read_text()
    assert text.endswith("length\n")
    assert 30 < text.count("\n") < 45


def test_what_a_killed_program_left_stands_in_no_ones_way_and_is_removed(tmp_path):
    folder, parts = tmp_path / "out", tmp_path / "out" / "parts"
    parts.mkdir(parents=True)
    for leaving in (folder / LOCK, folder / ".a.77.partial.md", parts / ".b.77.partial.json"):
        leaving.touch()
    prepare_output_folder(folder)
    with locked(folder, "testing", keep=False):
        assert sorted(os.listdir(folder)) == [LOCK, "parts"]
    assert os.listdir(folder) == ["parts"]
    (parts / "whole.npz").touch()
    assert "is not empty (it holds 'parts')" in message_of(prepare_output_folder, folder)
