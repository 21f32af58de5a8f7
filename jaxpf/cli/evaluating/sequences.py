"""``jaxpf evaluate`` on several sequences: one evaluation per sequence, and an overall table."""

import dataclasses
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import click

from jaxpf.cli.evaluating.request import Request
from jaxpf.cli.shared.config import write_config
from jaxpf.cli.shared.console import print_table
from jaxpf.cli.shared.scene_options import resolved_scene, scene_name
from jaxpf.contract.errors import InputError
from jaxpf.files.reading import read_text

#: Options that apply to a single sequence only.
_OF_ONE = ("ids", "start_frame", "tracks")


class Listed(NamedTuple):
    """One of several scenes: name of its results, source, seed and frames."""

    name: str
    source: str
    seed: int
    frames: int | None = None


def sequences_of(request: Request) -> list[Listed]:
    """List the scenes of a folder of sequences or of a text file; none for a single scene.

    Raises:
        InputError: a line of the file is not a scene and a seed.
    """
    from scenes.sequences import sequences_in

    path, seed = Path(request.scene), request.options.scene_seed
    if path.suffix == ".txt" and path.is_file():
        expected = "a scene in each line, with an optional seed after it"
        lines = enumerate(read_text(path, "scenes", f"{expected}.").splitlines(), start=1)
        scenes = [
            _of_line(f"line {number} of '{path}'", line.split(), seed, path.parent)
            for number, line in lines
            if line.strip() and not line.lstrip().startswith("#")
        ]
        if not scenes:
            raise InputError(f"'{path}' lists no scene; give {expected}.")
        return scenes
    return [Listed(each.name, str(each), seed) for each in sequences_in(path)]


def _of_line(place: str, words: Sequence[str], seed: int, folder: Path) -> Listed:
    if len(words) > 2 or (len(words) == 2 and not words[1].isdecimal()):
        raise InputError(
            f"{place} reads {' '.join(words)!r}; write a scene, and a seed after it if it has one."
        )
    source, *rest = words
    beside = folder / source.rpartition(":")[0] if ":" in source else folder / source
    if beside.exists() and source != ".":
        source = str(folder / source)
    name = "-".join([scene_name(source), *rest])
    return Listed(name, resolved_scene(source), int(rest[0]) if rest else seed)


def evaluate_each(
    request: Request, listed: Sequence[Listed], evaluate: Callable[[Request], None]
) -> None:
    """Evaluate scenes one after another, then print results over all of them.

    Args:
        request: common to all scenes.
        listed: the scenes.
        evaluate: runs one request.

    Raises:
        InputError: an option applies to a single sequence only, or fewer than two scenes are of one
            kind.
    """
    options, output = request.options, request.output
    for name in _OF_ONE:
        if getattr(options, name):
            flag = f"--{name.replace('_', '-')}"
            raise InputError(f"{flag} works only for a single sequence; leave it out, or name one.")
    kind, chosen = _of_one_kind(listed, options.target, options.frames)
    if len(chosen) < 2:
        raise InputError(
            f"'{request.scene}' holds {len(chosen)} sequence(s) that can be evaluated together; "
            "give at least 2, or name one of them."
        )
    for number, sequence in enumerate(chosen, start=1):
        click.echo(f"\n{sequence.name} ({number} of {len(chosen)})")
        own = dataclasses.replace(
            options,
            target=kind,
            scene_seed=sequence.seed,
            frames=sequence.frames,
            output=output / sequence.name,
        )
        evaluate(dataclasses.replace(request, scene=sequence.source, options=own))
    if options.dry_run:
        return
    from jaxpf.evaluation.output.overall import FILES, UNITS, write_overall

    tables = write_overall(output, [sequence.name for sequence in chosen], request.varied)
    click.echo()
    for table in tables:
        print_table(*table)
    write_config(output / "run.toml", "evaluate", request.table())
    click.echo(UNITS)
    click.echo(f"{output}/: {', '.join(FILES)}, run.toml, and a folder for each sequence")


def _of_one_kind(
    listed: Sequence[Listed], kind: str | None, frames: int | None
) -> tuple[str | None, list[Listed]]:
    """Select scenes with a given kind of truth (default: the first scene's) and at most N frames.

    Prints which scenes are left out.
    """
    from jaxpf.evaluation.opening import load_scene
    from jaxpf.evaluation.work.scene import start_frame
    from jaxpf.targets import adapter_of_scene
    from scenes import open_folder

    chosen: list[Listed] = []
    for sequence in listed:
        try:
            is_folder = Path(sequence.source).is_dir()
            scene = load_scene(sequence.source, sequence.seed, num_frames=2 if is_folder else None)
            kind = adapter_of_scene(scene, kind).name
        except InputError as error:
            click.echo(f"{sequence.name} is left out: {error}", err=True)
            continue
        if sequence.name in {other.name for other in chosen}:
            raise InputError(
                f"two sequences are called {sequence.name!r}; list it once, or give one "
                "another seed."
            )
        most = frames
        if is_folder and frames is not None:
            most = min(frames, open_folder(sequence.source).num_frames - start_frame(scene))
        chosen.append(sequence._replace(frames=most))
    return kind, chosen
