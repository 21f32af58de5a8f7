import os
from pathlib import Path

import pytest

_BESIDE_THE_PROJECT = Path(__file__).resolve().parents[2] / "shared" / "data"


@pytest.fixture(scope="session")
def data_folder() -> Path:
    """Where the annotated real clips lie; tests that need them are skipped without them."""
    folder = Path(os.environ.get("JAXPF_DATA", _BESIDE_THE_PROJECT))
    if not folder.is_dir():
        pytest.skip(
            f"no real clips: {folder} does not exist; put them into ../shared/data beside the "
            "project or name their folder in JAXPF_DATA"
        )
    return folder
