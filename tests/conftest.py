import gc
import os
import sys
from pathlib import Path

import pytest
from older_emitters import HAS_OLDER_EMITTERS

pytest_plugins = ["divided_tests"]
_BESIDE_THE_PROJECT = Path(__file__).resolve().parents[2] / "shared" / "data"


#: A third less to do in all; the arithmetic is the same, but for the last bits.  Programs are
#: compiled in one piece: a worker has one core.
_COMPILE_QUICKLY = (
    "--xla_backend_optimization_level=0 --xla_llvm_disable_expensive_passes=true "
    "--xla_cpu_parallel_codegen_split_count=1"
)
_OLDER_EMITTERS = " --xla_cpu_use_fusion_emitters=false"
#: Read by JAX when it starts.
_QUICKLY = "JAX_DISABLE_MOST_OPTIMIZATIONS"


#: Python looks for garbage so often that it takes a tenth of all time while JAX traces.
_GARBAGE = 50_000, 10, 10


def _has_accelerator() -> bool:
    """Whether JAX will use a GPU, where flags of the CPU's compiler end workers.

    Asking JAX would start it before the workers' settings.
    """
    wanted = os.environ.get("JAX_PLATFORMS", "")
    return "cpu" not in wanted and Path("/dev/nvidiactl").exists()


def pytest_configure(config: pytest.Config) -> None:
    """Share one compile cache: what a test compiles, workers and started programs find again.

    So do later runs: the next try, and other files' tests (``--cache-clear`` empties it).  The
    first test command compiles all programs quickly; see also ``compiled_quickly``.
    """
    gc.set_threshold(*_GARBAGE)
    if hasattr(config, "workerinput"):
        return  # pytest-xdist's workers inherit the environment
    # Workers of the next run find the tests' bytecode: rewriting assertions takes 8 seconds each.
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    if "not slow" in config.option.markexpr:
        if not _has_accelerator():
            flags = _COMPILE_QUICKLY + _OLDER_EMITTERS * HAS_OLDER_EMITTERS
            os.environ.setdefault("XLA_FLAGS", flags)
    elif not _has_accelerator():
        os.environ[_QUICKLY] = "True"
    folder = str(config.cache.mkdir("jaxpf-compiled"))
    os.environ |= {
        "JAXPF_CACHE_DIR": folder,
        "JAX_COMPILATION_CACHE_DIR": folder,
        "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0.1",
        "JAX_PERSISTENT_CACHE_MIN_ENTRY_SIZE_BYTES": "-1",
        "JAX_TRACEBACK_IN_LOCATIONS_LIMIT": "0",  # nobody reads them, and lowering writes them
    }


#: Linux gives a process 65 530 memory maps by default; a program that does not get one crashes.
_MOST_MAPS = 30_000


@pytest.fixture(autouse=True, scope="module")
def few_programs():
    """Let go of compiled programs, some maps each, before a long run has too many of them."""
    yield
    maps = Path("/proc/self/maps")
    if "jax" in sys.modules and maps.exists():
        with maps.open("rb") as file:
            number = sum(1 for _ in file)
        if number > _MOST_MAPS:
            sys.modules["jax"].clear_caches()
            gc.collect()


@pytest.fixture(autouse=True, scope="module")
def compiled_quickly(request):
    """Compile slow tests, too, as the first test command does: they compile longer than they run.

    Programs that they start do the same.  Modules with the mark ``compiled_as_by_users`` compare
    bits, take their time to run, or are about what users start.
    """
    quickly = str(request.node.get_closest_marker("compiled_as_by_users") is None)
    if os.environ.get(_QUICKLY, quickly) != quickly:
        import jax

        os.environ[_QUICKLY] = quickly
        jax.config.update(_QUICKLY.lower(), quickly == "True")
        jax.clear_caches()


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


@pytest.fixture
def boxes_file(tmp_path):
    def write(text, name="boxes.txt"):
        path = tmp_path / name
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return path

    return write
