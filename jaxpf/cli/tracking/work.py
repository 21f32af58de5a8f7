"""``jaxpf track`` in steps: open, build, stream and write, report; ``request_of`` parses."""

import contextlib
import warnings

from jaxpf.cli.shared.startup import use_compile_cache
from jaxpf.cli.tracking.finishing import finish
from jaxpf.cli.tracking.recorder import record
from jaxpf.cli.tracking.request import Request
from jaxpf.cli.tracking.session import open_session
from jaxpf.files import writing


def track(request: Request) -> None:
    """Track, and write each frame into the output folder at once.

    After an interruption or an error the tracked frames are kept, and ``finish`` reports them; a
    run without any tracked frame leaves no files.
    """
    session = open_session(request)
    use_compile_cache()
    session.build()
    existed = session.output.is_dir()
    writing.prepare_output_folder(session.output, request.run.overwrite)
    with warnings.catch_warnings():
        # At the end, the program says how many there were.
        warnings.filterwarnings("ignore", "the log-likelihood of frame", UserWarning)
        record(session)
    if not session.is_kept and not existed:
        with contextlib.suppress(OSError):
            session.output.rmdir()
    finish(session)
