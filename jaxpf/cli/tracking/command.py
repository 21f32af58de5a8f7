"""``jaxpf track``: one command for every target, each with options of its own."""

import functools
from typing import Any

import click

from jaxpf import filters
from jaxpf.cli.shared.config import config_flag, target_in
from jaxpf.cli.shared.flags import Command, Flag, declared_flags, filter_flags, start_flags
from jaxpf.cli.tracking.request import OF_BOXES, Run, request_of
from jaxpf.contract.errors import InputError
from jaxpf.contract.options import options_of
from jaxpf.populations.lifetimes import Rules
from jaxpf.targets import DEFAULT, adapters, find_adapter
from jaxpf.targets.adapter import Adapter

_FILTER = f"How guesses are organised: {', '.join(filters.all_filters())}.  [default: by --method]"


class TrackCommand(Command):
    """``jaxpf track`` for one target."""

    def __init__(self, adapter: Adapter):
        about = _ABOUT.format(what=adapter.name)
        named = "" if adapter.name == DEFAULT else f" {adapter.name}"
        if adapter.name == DEFAULT:
            others = [name for name in adapters() if name != DEFAULT]
            about += _OTHERS.format(others="|".join(others))
        super().__init__(
            adapter.name,
            params=list(_params(adapter)),
            callback=_track,
            more=_LIVE,
            help=f"{about}Example: jaxpf track{named} clip.mp4 {adapter.example}",
        )
        self.adapter, self.table = adapter, "track"

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """As click does; of another target's option it says how it is spelt."""
        try:
            return super().parse_args(ctx, args)
        except click.NoSuchOption as error:
            if hint := self.hint(error.option_name):
                raise InputError(hint) from None
            raise

    def hint(self, flag: str) -> str:
        """What to write for a flag that is not of this target; "" where nobody has it."""
        others = [name for name in adapters() if name != self.adapter.name]
        if flag == "--target":
            return (
                f"what is tracked stands before the video, as in `jaxpf track {others[0]} VIDEO "
                "...`; leave --target out."
            )
        having = [name for name in others if _has(find_adapter(name), flag)]
        if not having or _has(self.adapter, flag):
            return ""
        return (
            f"{flag} is an option of {' and '.join(having)}, and {self.adapter.name} are tracked; "
            f"write `jaxpf track {having[0]} VIDEO ...`, or leave it out."
        )


_ABOUT = """Track {what} through VIDEO: a video file, a folder of images, or what is live: the
index of a camera, the address of a stream (http://, rtsp://, ...), a pipe.

Filtering begins after the start frame.  The output folder receives tracks.csv, uncertainty.csv,
overlay.mp4, diagnostics, summary.json, and run.toml, which repeats the run: `jaxpf track --config
run.toml -o ANOTHER`.

"""
_OTHERS = """What is no box: `jaxpf track {others} VIDEO`.

"""
_LIVE = """What is live is tracked until it ends or Ctrl-C is pressed, which keeps all results.  A
stream's start frame is its first one.  A camera's is taken once everything is compiled: the objects
must be where they start until a line says that tracking begins; `jaxpf frame 0 -n 30` shows what
camera 0 sees.

A video that is called as a target, such as points, is ./points."""


def _has(adapter: Adapter, flag: str) -> bool:
    return any(flag in param.opts for param in _params(adapter))


@functools.cache
def _params(adapter: Adapter) -> list[click.Parameter]:
    run = options_of(Run)
    if not adapter.target.has_boxes:
        run = {name: one for name, one in run.items() if name not in OF_BOXES}
    if not adapter.target.fits_motion:
        del run["fit_motion"]

    def of_run(section: str, *names: str, but: tuple[str, ...] = ()) -> list[Flag]:
        those = {n: one for n, one in run.items() if n not in but and (not names or n in names)}
        return declared_flags(
            those,
            section,
            rare=("codec", "tracker", "error_bars", "smooth", "smooth_lag", "save_state", "resume"),
        )

    early, of_model = ("start", "frames"), ("fit_motion",)
    flags: list[click.Parameter] = [click.Argument(["video"])]
    flags += start_flags(adapter.start_flags, "Start") + of_run("Start", *early)
    flags += declared_flags(options_of(adapter.target.options), "Model") + of_run(
        "Model", *of_model
    )
    flags += [Flag(["--filter"], section="Filter", common=False, help=_FILTER)]
    flags += filter_flags(adapter.target.defaults)
    if "births" in adapter.start_flags:
        flags += declared_flags(options_of(Rules), "Births and deaths")
    flags += of_run("Run and output", but=early + of_model)
    return [*flags, config_flag("Run and output")]


class _Targets(click.Group):
    """The commands of all targets; without the name of one, that of boxes."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(adapters())

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        return TrackCommand(find_adapter(name)) if name in adapters() else None

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        if not args or args[0] not in adapters():
            args = [target_in(args) or DEFAULT, *args]
        return super().parse_args(ctx, args)


command = _Targets("track")


@click.pass_context
def _track(ctx: click.Context, **_: Any) -> None:
    assert isinstance(ctx.command, TrackCommand)
    request = request_of(ctx, ctx.command.adapter)
    from jaxpf.cli.tracking.work import track

    track(request)
