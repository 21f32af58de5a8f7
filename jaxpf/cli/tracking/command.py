"""``jaxpf track``: one command per kind of target, with that target's options."""

import functools
from typing import Any

import click

from jaxpf.cli.shared.config import config_flag, target_in
from jaxpf.cli.shared.flags import Command, Flag, declared_flags, filter_flags, start_flags
from jaxpf.cli.tracking.request import OF_BOXES, Run, request_of
from jaxpf.contract.errors import InputError
from jaxpf.contract.options import options_of
from jaxpf.detections.lifetimes import Rules
from jaxpf.targets import DEFAULT, all_targets, find_target
from jaxpf.targets.building import filter_for
from jaxpf.targets.target import Target


class TrackCommand(Command):
    """``jaxpf track`` for one target."""

    def __init__(self, target: Target):
        about = _ABOUT.format(what=target.name)
        named = "" if target.name == DEFAULT else f" {target.name}"
        if target.name == DEFAULT:
            others = [name for name in all_targets() if name != DEFAULT]
            about += _OTHERS.format(others="|".join(others))
        super().__init__(
            target.name,
            params=list(_params(target)),
            callback=_track,
            more=_LIVE,
            help=f"{about}Example: jaxpf track{named} clip.mp4 {target.example}",
        )
        self.target, self.table = target, "track"

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse as click does, with a hint for an option of another kind of target."""
        try:
            return super().parse_args(ctx, args)
        except click.NoSuchOption as error:
            if hint := self.hint(error.option_name):
                raise InputError(hint) from None
            raise

    def hint(self, flag: str) -> str:
        """Suggest a command for a flag of another kind of target; "" if no kind has it."""
        others = [name for name in all_targets() if name != self.target.name]
        if flag == "--target":
            return (
                "--target is not an option: name the kind of target before the video, as in "
                f"`jaxpf track {others[0]} VIDEO ...`."
            )
        having = [name for name in others if _has(find_target(name), flag)]
        if not having or _has(self.target, flag):
            return ""
        return (
            f"{flag} works only for {' and '.join(having)}; write `jaxpf track {having[0]} VIDEO "
            "...`, or leave it out."
        )


_ABOUT = """Track {what} through VIDEO: a video file or a folder of images.  VIDEO can also be a
camera index or a stream's address (http://, rtsp://, ...).

The output folder receives tracks.csv (a row per frame and object, with 95% intervals),
overlay.mp4, trajectories.png, summary.json (a verdict on each object), diagnostics.csv, and
run.toml, which repeats the run: `jaxpf track --config run.toml -o ANOTHER`.  An object is lost in a
frame where it is outside the picture, all its particles have likelihood zero, or its confidence is
below 0.5.

"""
_OTHERS = """Other kinds of target: `jaxpf track {others} VIDEO`.

"""
_LIVE = """A live source is tracked until it ends or you press Ctrl-C, which keeps all results.  Its
start frame is its first one, unless --start leaves some out, as while a camera adjusts its
exposure; keep the objects in place while the first frame is compiled.

For a video file named like a kind of target, such as points, write ./points."""


def _has(target: Target, flag: str) -> bool:
    return any(flag in param.opts for param in _params(target))


@functools.cache
def _params(target: Target) -> list[click.Parameter]:
    run = options_of(Run)
    if not target.has_boxes:
        run = {name: option for name, option in run.items() if name not in OF_BOXES}

    def of_run(section: str, *names: str, but: tuple[str, ...] = ()) -> list[Flag]:
        those = {
            n: option for n, option in run.items() if n not in but and (not names or n in names)
        }
        return declared_flags(
            those,
            section,
            rare=("range", "tracker", "save_state", "resume"),
        )

    early = ("start", "frames")
    flags: list[click.Parameter] = [click.Argument(["video"])]
    flags += start_flags(target.start_flags, "Start") + of_run("Start", *early)
    flags += declared_flags(options_of(target.tracker), "Model")
    flags += filter_flags(target.defaults, family=filter_for(target), unsuited=target.unsuited)
    if "detections" in target.start_flags:
        flags += declared_flags(options_of(Rules), "With --detections")
    flags += of_run("Run and output", but=early)
    return [*flags, config_flag("Run and output")]


class _Targets(click.Group):
    """Commands of all kinds of target; defaults to boxes."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(all_targets())

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        return TrackCommand(find_target(name)) if name in all_targets() else None

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        if not args or args[0] not in all_targets():
            args = [target_in(args) or DEFAULT, *args]
        return super().parse_args(ctx, args)


command = _Targets("track")


@click.pass_context
def _track(ctx: click.Context, **_: Any) -> None:
    assert isinstance(ctx.command, TrackCommand)
    request = request_of(ctx, ctx.command.target)
    from jaxpf.cli.tracking.run import track

    track(request)
