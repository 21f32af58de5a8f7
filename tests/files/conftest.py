import pytest


@pytest.fixture
def boxes_file(tmp_path):
    def write(text, name="boxes.txt"):
        path = tmp_path / name
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return path

    return write
