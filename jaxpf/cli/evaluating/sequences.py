"""``jaxpf evaluate`` on several sequences: one evaluation per sequence, and an overall table."""

from collections.abc import Callable, Sequence
from pathlib import Path

from jaxpf.cli.evaluating.request import Request
from jaxpf.cli.shared.config import write_config
from jaxpf.cli.shared.console import print_table, say
from jaxpf.contract.errors import InputError
from jaxpf.evaluation.overall import FILES, about_units, write_overall
from jaxpf.evaluation.scene import start_frame
from jaxpf.sequences import open_sequence
from jaxpf.targets import target_of_scene

#: Options that apply to a single sequence only.
_OF_ONE = ("ids", "start_frame", "tracks")


def evaluate_each(
    request: Request,
    folders: Sequence[Path],
    evaluate: Callable[[Request], None],
) -> None:
    """Evaluate sequences one after another, then print results over all of them.

    Args:
        request: common to all sequences.
        folders: of the sequences.
        evaluate: runs one request and writes its tables.

    Raises:
        InputError: an option applies to a single sequence only, or fewer than two sequences are of
            one kind.
    """
    options, output = request.options, request.output
    for name in _OF_ONE:
        if getattr(options, name):
            flag = f"--{name.replace('_', '-')}"
            raise InputError(f"{flag} works only for a single sequence; leave it out, or name one.")
    kind, chosen = _of_one_kind(folders, options.target, options.frames)
    if len(chosen) < 2:
        raise InputError(
            f"'{request.scene}' holds {len(chosen)} sequence(s) that can be evaluated together; "
            "give at least 2, or name one of them."
        )
    for number, (folder, frames) in enumerate(chosen.items(), start=1):
        say(f"\n{folder.name} ({number} of {len(chosen)})")
        evaluate(request.of_sequence(folder, kind, frames))
    if options.dry_run:
        return
    say()
    names = [folder.name for folder in chosen]
    for title, table in write_overall(output, names, request.varied).items():
        print_table(title, [*table.columns], table.to_numpy().tolist())
    write_config(output / "run.toml", "evaluate", request.table())
    say(about_units(len(chosen)))
    say(f"{output}/: {', '.join(FILES)}, run.toml, and a folder for each sequence")


def _of_one_kind(
    folders: Sequence[Path], kind: str | None, most: int | None
) -> tuple[str | None, dict[Path, int | None]]:
    """Select sequences with a given kind of truth (default: the first's) and at most N frames.

    Prints which sequences are left out.
    """
    chosen: dict[Path, int | None] = {}
    for folder in folders:
        try:
            sequence = open_sequence(folder)
            scene = sequence.scene(num_frames=2)
            kind = target_of_scene(scene, kind).name
        except InputError as error:
            say(f"{folder.name} is left out: {error}", err=True)
            continue
        available = sequence.num_frames - start_frame(scene)
        chosen[folder] = None if most is None else min(most, available)
    return kind, chosen
