"""``jaxpf track``: one command per kind of target, with that target's options."""

from typing import Any

import click

from jaxpf.cli.shared.flags import Command, config_flag, declared_flags, start_flags, target_in
from jaxpf.cli.shared.scene_options import filter_options
from jaxpf.cli.tracking.request import OF_BOXES, Run, request_of
from jaxpf.cli.tracking.run import track
from jaxpf.contract.options import options_of
from jaxpf.detections.lifetimes import Rules
from jaxpf.targets.registry import DEFAULT, all_targets, find_target
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
            params=_params(target),
            callback=_track,
            where=f"jaxpf.{target.name}.tracker and jaxpf.filters",
            help=f"{about}{_LIVE}Example: jaxpf track{named} clip.mp4 {target.example}",
        )
        self.target, self.table = target, "track"


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

For a video file named like a kind of target, such as points, write ./points.

"""


def _params(target: Target) -> list[click.Parameter]:
    run = options_of(Run)
    if not target.has_boxes:
        run = {name: option for name, option in run.items() if name not in OF_BOXES}
    early = {name: run.pop(name) for name in ("start", "frames")}
    flags: list[click.Parameter] = [click.Argument(["video"])]
    flags += start_flags(target.start_flags, "Start")
    flags += declared_flags(early, "Start")
    flags += declared_flags(options_of(target.tracker), "Model")
    flags += declared_flags(filter_options(target.unsuited), "Filter", defaults=target.defaults)
    if "detections" in target.start_flags:
        flags += declared_flags(options_of(Rules), "With --detections")
    return [*flags, *declared_flags(run, "Run and output"), config_flag("Run and output")]


class _Targets(click.Group):
    """Commands of all kinds of target; defaults to boxes."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(all_targets())

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        return TrackCommand(find_target(name)) if name in all_targets() else None

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        if not args or args[0] not in all_targets():
            args = [find_target(target_in(args) or DEFAULT).name, *args]
        return super().parse_args(ctx, args)


command = _Targets("track")


@click.pass_context
def _track(ctx: click.Context, **_: Any) -> None:
    assert isinstance(ctx.command, TrackCommand)
    track(request_of(ctx, ctx.command.target))
