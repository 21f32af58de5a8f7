"""The command line.  The module of a command is imported only when it runs."""

import contextlib
import errno
import importlib
import os
import sys
from typing import Any, NoReturn

try:
    import click

    from jaxpf import __version__
    from jaxpf.cli.shared.console import say
except ModuleNotFoundError:  # pragma: no cover - depends on the installed extras
    sys.exit("the command line needs its extra packages: pip install 'jaxpf[cli]'")

# Name -> (module[:command], one-line help).  Stated here so that `jaxpf --help` imports no command.
_COMMANDS = {
    "example": ("jaxpf.cli.example", "Write a small clip to try, and print how to track it."),
    "track": (
        "jaxpf.cli.tracking.command",
        "Track objects through a video; write tracks, video and plots.",
    ),
    "mark": ("jaxpf.cli.marking.command:mark", "Draw start boxes and other shapes in the browser."),
    "view": ("jaxpf.cli.marking.command:view", "Review tracks in the browser, and correct them."),
    "contour": ("jaxpf.cli.contour", "Learn what contours look like and how they move."),
    "evaluate": (
        "jaxpf.cli.evaluating.command",
        "Compare methods over many runs on a scene or a clip.",
    ),
    "tune": (
        "jaxpf.cli.tuning.command",
        "Tune parameters by gradient descent.",
    ),
    "export": (
        "jaxpf.cli.export",
        "Write tracks for COCO, CVAT, MOT, DeepLabCut and SLEAP.",
    ),
    "demo": ("jaxpf.cli.demo", "Compare SIR, PS, DPS and SPS on a synthetic scene."),
    "reproduce": ("jaxpf.cli.reproduce", "Repeat a paper's experiment; judge its claims."),
    "verdicts": ("jaxpf.cli.verdicts", "Print the stored verdicts on the papers' claims."),
}


class _LazyGroup(click.Group):
    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(_COMMANDS)

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        if name not in _COMMANDS:
            return None
        module, _, attribute = _COMMANDS[name][0].partition(":")
        return getattr(importlib.import_module(module), attribute or "command")

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl([(name, help_) for name, (_, help_) in _COMMANDS.items()])


@click.group(
    cls=_LazyGroup,
    commands=dict.fromkeys(_COMMANDS, click.Command(None)),  # names, for suggestions
    context_settings={"help_option_names": ["-h", "--help"]},
    help="Particle filters for visual tracking and state-space models, in JAX.",
    epilog="`jaxpf COMMAND --help` explains a command.  A first look: `jaxpf demo`.",
)
@click.version_option(__version__, prog_name="jaxpf")
def group() -> None:
    """Hold the commands."""


def main(arguments: list[str] | None = None) -> Any:
    """Run the command line; a user error prints one sentence and exits with code 2."""
    from jaxpf.contract.errors import InputError

    if sys.stderr is None:  # closed, as by `2>&-`
        sys.stderr = open(os.devnull, "w")  # noqa: SIM115
    if sys.stdout is None:
        _refuse("standard output is closed; leave it open, or send it to a file.")
    try:
        if arguments is None:
            from jaxpf.cli.shared.stopping import heed_ctrl_c

            heed_ctrl_c()
        outcome = group.main(arguments, prog_name="jaxpf", standalone_mode=False)
        sys.stdout.flush()
        return outcome
    except InputError as error:
        _refuse(_cut(str(error)))
    except click.ClickException as error:
        if type(error).__name__ == "NoArgsIsHelpError":  # in newer versions of click
            error.show()
            sys.exit(error.exit_code)
        context = getattr(error, "ctx", None)
        more = f"  See `{context.command_path} --help`." if context else ""
        message = _cut(" ".join(error.format_message().split()))
        _refuse(message + more, error.exit_code)
    except (KeyboardInterrupt, click.Abort) as stop:
        # click wraps KeyboardInterrupt.
        terminated = "Terminated" in (type(stop).__name__, type(stop.__cause__).__name__)
        say("Terminated." if terminated else "Interrupted.", err=True)
        sys.exit(143 if terminated else 130)
    except BrokenPipeError:
        _end_quietly()
    except SystemExit:
        if hasattr(sys.stdout, "wrapped"):  # by click, which ends with 1 on a broken pipe
            _end_quietly()
        raise
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        if error.filename is not None:
            _refuse(f"cannot use {_cut(str(error.filename), 120)!r}: {reason}.")
        if error.errno not in _NOT_WRITTEN:
            raise
        _discard_output()
        _refuse(f"cannot write the output: {reason}; free some space, or write elsewhere.")
    except (MemoryError, RuntimeError) as error:
        if not (isinstance(error, MemoryError) or "RESOURCE_EXHAUSTED" in str(error)):
            raise
        _refuse("there is not enough memory; use fewer particles (-n), or smaller frames.")


def _refuse(sentence: str, code: int = 2) -> NoReturn:
    say(f"Error: {sentence}".replace("\n", "\\n"), err=True)
    sys.exit(code)


def _end_quietly() -> NoReturn:
    """The reader of the pipe has exited (`jaxpf ... | head`), which is no error."""
    _discard_output()
    sys.exit(0)


#: Errors of writing to a full or broken disk, beyond a quota, or to what is open for reading only.
_NOT_WRITTEN = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EBADF}


def _discard_output() -> None:
    """Discard buffered output, or Python would fail again on exit."""
    with contextlib.suppress(OSError, ValueError):  # standard output may not be a file
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _cut(text: str, most: int = 2000) -> str:
    """Shorten a text of arbitrary length for a message."""
    return text if len(text) <= most else f"{text[: most // 2]}...{text[-most // 2 :]}"
