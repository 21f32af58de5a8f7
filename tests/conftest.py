import gc
import os
import sys
from importlib.metadata import version
from pathlib import Path

import pytest

pytest_plugins = ["divided_tests", "processor_time"]
_BESIDE_THE_PROJECT = Path(__file__).resolve().parents[2] / "shared" / "data"


#: Programs are compiled in one piece: a worker has one core.
_ONE_PIECE = "--xla_cpu_parallel_codegen_split_count=1"
#: Where little is optimised, the older emitters take half as long as the new ones.  jaxlib 0.12 has
#: none, and ends a process that asks for them.
_OLDER_EMITTERS = " --xla_cpu_use_fusion_emitters=false"
_HAS_OLDER_EMITTERS = tuple(map(int, version("jaxlib").split(".")[:2])) < (0, 11)
#: Read by JAX when it starts.  The arithmetic is the same, but for the last bits.
_QUICKLY = "JAX_DISABLE_MOST_OPTIMIZATIONS"


#: Python looks for garbage so often that it takes a tenth of all time while JAX traces.
_GARBAGE = 50_000, 10, 10
#: What compiled programs may take on the disk; the oldest go first.
_CACHE_BYTES = 2 * 2**30


def _has_accelerator() -> bool:
    """Whether JAX will use a GPU, where flags of the CPU's compiler end workers.

    Asking JAX would start it before the workers' settings.
    """
    wanted = os.environ.get("JAX_PLATFORMS", "")
    return "cpu" not in wanted and Path("/dev/nvidiactl").exists()


def _compile_cache() -> Path:
    """The folder of compiled programs outside of the clone, one for each jaxlib, bounded in size.

    Within it, JAX's own key holds the flags.
    """
    base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache", "jaxpf-tests")
    folder = base / f"jaxlib-{version('jaxlib')}"
    folder.mkdir(parents=True, exist_ok=True)
    files = [(path, path.stat()) for path in base.rglob("*") if path.is_file()]
    excess = sum(stat.st_size for _, stat in files) - _CACHE_BYTES
    for path, stat in sorted(files, key=lambda file: file[1].st_mtime):
        if excess <= 0:
            break
        path.unlink(missing_ok=True)
        excess -= stat.st_size
    return folder


def pytest_configure(config: pytest.Config) -> None:
    """Share one compile cache: what a test compiles, workers and started programs find again.

    So do later runs, in other clones as well.  Programs are compiled quickly, since they cost more
    to compile than to run; see ``compiled_by_users``.
    """
    gc.set_threshold(*_GARBAGE)
    if hasattr(config, "workerinput"):
        return  # pytest-xdist's workers inherit the environment
    # Workers of the next run find the tests' bytecode: rewriting assertions takes 8 seconds each.
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    if not _has_accelerator():
        os.environ.setdefault("XLA_FLAGS", _ONE_PIECE + _OLDER_EMITTERS * _HAS_OLDER_EMITTERS)
        os.environ[_QUICKLY] = "True"
        if "jax" in sys.modules:  # by a plugin
            sys.modules["jax"].config.update(_QUICKLY.lower(), True)
    folder = str(_compile_cache())
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
def compiled_by_users(request):
    """Optimise the programs of slow tests in modules with the mark ``compiled_as_by_users``.

    These compare bits, take their time to run, or start programs as users do.
    """
    by_users = request.node.get_closest_marker("compiled_as_by_users") is not None
    if not by_users or _has_accelerator() or "not slow" in request.config.option.markexpr:
        yield
        return
    import jax

    jax.devices()  # JAX reads the flags when it starts
    flags = {name: os.environ.pop(name) for name in (_QUICKLY, "XLA_FLAGS") if name in os.environ}
    jax.config.update(_QUICKLY.lower(), False)
    jax.clear_caches()
    yield
    os.environ |= flags
    jax.config.update(_QUICKLY.lower(), True)
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
