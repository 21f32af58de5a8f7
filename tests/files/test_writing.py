import os

import pytest

from jaxpf import InputError
from jaxpf.files.writing import atomic_write, prepare_output_folder


def message_of(call, *arguments):
    with pytest.raises(InputError) as caught:
        call(*arguments)
    return str(caught.value)


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
    message = message_of(write, tmp_path / "gone" / "a.json")
    assert f"cannot write '{tmp_path / 'gone' / 'a.json'}': no such file or directory" in message
    assert "not a directory" in message_of(write, tmp_path / "file" / "a.json")
    with pytest.raises(ValueError, match="'w' or 'wb'"), atomic_write(tmp_path / "a", "r"):
        pass


def test_an_output_folder_is_created_or_reused_when_empty(tmp_path):
    folder = prepare_output_folder(tmp_path / "a" / "b")
    assert folder.is_dir()
    assert prepare_output_folder(folder) == folder
    assert os.listdir(folder) == []


def test_an_output_folder_with_files_needs_overwrite(tmp_path):
    (tmp_path / "tracks.txt").write_text("old")
    message = message_of(prepare_output_folder, tmp_path)
    assert f"output folder '{tmp_path}' is not empty (it holds 'tracks.txt')" in message
    assert "another folder or add --overwrite" in message
    assert prepare_output_folder(tmp_path, overwrite=True) == tmp_path
    assert (tmp_path / "tracks.txt").read_text() == "old"


def test_an_output_folder_that_is_a_file_or_cannot_be_made_is_refused(tmp_path, monkeypatch):
    (tmp_path / "file").touch()
    message = message_of(prepare_output_folder, tmp_path / "file")
    assert f"output folder '{tmp_path / 'file'}' is a file; choose another folder" in message
    message = message_of(prepare_output_folder, tmp_path / "file" / "sub")
    assert f"cannot create the output folder '{tmp_path / 'file' / 'sub'}'" in message

    def refuse(self):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("pathlib.Path.touch", refuse)
    message = message_of(prepare_output_folder, tmp_path / "new")
    assert "cannot write into the output folder" in message
    assert "permission denied" in message
