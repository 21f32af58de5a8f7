"""Pages of the site that are written from the program: commands, modules, verdicts, scenes."""

import importlib
import inspect

import click
import cv2
import jax
import numpy as np

import jaxpf
import scenes
from jaxpf import cli, media
from jaxpf.papers import PAPERS
from jaxpf.papers.judging import verdicts
from jaxpf.papers.judging.claims import read_rows
from jaxpf.papers.paper import claims_markdown, markdown_table

#: The package's own page: the names in the order in which they are met, by their purpose.
PACKAGE = {
    "Models": "state_space Partitioned Labelled PFFL Eskil pytree_dataclass",
    "Filtering, smoothing and simulation": "run stream monte_carlo smooth simulate forecast "
    "log_evidence use_cores",
    "Parameters": "pmmh tune",
    "States and files": "ParticleState Summary save load InputError",
}
FIRST = {names.split()[0]: title for title, names in PACKAGE.items()}
#: How that page begins; the docstring is the map for those who work on the code.
WELCOME = """\
Build a model by :func:`jaxpf.state_space` from plain functions, or a tracker of a video by
:func:`jaxpf.boxes.tracker`, :func:`jaxpf.parts.tracker`, :func:`jaxpf.points.tracker` or
:func:`jaxpf.contours.tracker`.  Then filter by :func:`jaxpf.run`, frame by frame by
:func:`jaxpf.stream`, or in many runs at once by :func:`jaxpf.monte_carlo`.

In the examples, ``tracker`` is a model of observations ``y``, and ``key`` is ``jax.random.key(0)``.
"""
#: The function of ``contract`` that users call; the others call what users write.
FOR_USERS = ("static_field",)


def write(folder):
    """Write all pages; those of an earlier build are replaced."""
    folder.mkdir(exist_ok=True)
    for old in folder.iterdir():
        old.unlink()
    names = [_command(folder, *each) for each in _commands(cli.group, ())]
    _contents(folder / "commands.rst", "Commands", names)
    modules = (name for name in jaxpf.__all__ if inspect.ismodule(getattr(jaxpf, name)))
    names = ["jaxpf", *(f"jaxpf.{name}" for name in modules)]
    documented = set()
    for name in reversed(names):  # the package's own page last: most of it stands elsewhere, too
        _module(folder, name, documented)
    _contents(folder / "reference.rst", "Reference", names)
    (folder / "verdicts.md").write_text(_verdicts())
    counted = (f"- {verdicts.summary(paper, verdicts.stored(paper))}\n" for paper in PAPERS)
    (folder / "counts.md").write_text("".join(counted))
    for name, picture in (*_pictures(), *_clouds()):
        cv2.imwrite(str(folder / f"{name}.png"), picture[..., ::-1])


def _commands(group, path):
    for name in group.list_commands(None):
        command = group.get_command(None, name)
        if isinstance(command, click.Group):
            yield from _commands(command, (*path, name))
        else:
            yield command, (*path, name)


def _command(folder, command, path):
    """Its whole help, as the terminal shows it."""
    title = " ".join(("jaxpf", *path))
    context = click.Context(command, info_name=title, terminal_width=79)
    lines = command.get_help(context).splitlines()
    body = "\n".join(f"   {line}".rstrip() for line in lines)
    name = "-".join(("jaxpf", *path))
    (folder / f"{name}.rst").write_text(f"{_titled(title)}\n.. code-block:: text\n\n{body}\n")
    return name


def _module(folder, address, documented):
    """A module's docstring, and that of every public name; links lead to a name's first page."""
    module = importlib.import_module(address)
    blocks = [_titled(address), WELCOME if module is jaxpf else f".. automodule:: {address}\n"]
    for name in _names(module):
        if module is jaxpf and name in FIRST:
            blocks.append(f"{FIRST[name]}\n{'-' * len(FIRST[name])}\n")
        value, place = getattr(module, name), f"{address}.{name}"
        again = "   :no-index:\n" if id(value) in documented else ""
        documented.add(id(value))
        if inspect.isclass(value):
            members = "   :members:\n   :member-order: bysource\n"
            blocks.append(f".. autoclass:: {place}\n{members}{again}")
        elif callable(value):
            blocks.append(f".. autofunction:: {place}\n{again}")
        else:
            blocks.append(f".. py:data:: {place}\n{again}   :value: {_short(value)}\n")
    (folder / f"{address}.rst").write_text("\n".join(blocks))


def _short(value):
    text = " ".join(repr(value).split())
    return text if len(text) <= 70 else f"{text[:66]} ..."


def _names(module):
    """The public names that users need."""
    if module is jaxpf:
        return " ".join(PACKAGE.values()).split()
    if listed := getattr(module, "__all__", None):
        return [name for name in listed if _is_for_users(module, name)]
    here = module.__name__
    return [
        name
        for name, value in vars(module).items()
        if not name.startswith("_") and callable(value) and value.__module__ == here
    ]


def _is_for_users(module, name):
    is_function = inspect.isfunction(getattr(module, name))
    return module is not jaxpf.contract or not is_function or name in FOR_USERS


def _contents(path, title, names):
    listed = "\n".join(f"   {name}" for name in names)
    path.write_text(f"{_titled(title)}\n.. toctree::\n   :maxdepth: 1\n\n{listed}\n")


def _titled(title):
    return f"{title}\n{'=' * len(title)}\n"


def _verdicts():
    """The stored verdicts, tables for each paper, and the claims that have none."""
    blocks = ["# Claims of five papers, and their verdicts\n"]
    for paper in PAPERS:
        judged, left = verdicts.stored(paper), read_rows(paper, "not_judged.csv")
        blocks += [
            f"## {verdicts.summary(paper, judged)}\n",
            f"Method: {verdicts.FORMS[paper]}; {verdicts.origin(judged)}.\n",
            *claims_markdown(judged, level=3),
            "### Not judged\n",
            *_rows(left),
            f"### {verdicts.EARLIER.capitalize()}\n",
            *_rows(read_rows(paper, "earlier.csv")),
        ]
    return "\n".join(blocks)


def _rows(rows):
    """A table of dictionaries, without their keys."""
    rows = [{name: text for name, text in row.items() if name != "key"} for row in rows]
    return [*markdown_table(list(rows[0]), [list(row.values()) for row in rows]), ""]


def _pictures():
    """What the trackers are given: synthetic scenes, with their truth in the middle of the clip."""
    people = scenes.street_scene(24)
    yield "street", media.draw_boxes(people.frames[-1], people.boxes[-1])
    puppet = scenes.puppet_scene(30)
    yield "puppet", _lines(puppet.frames[-1], puppet.extras["corners"][-1], closed=True)
    fish = scenes.make("fish", num_frames=10, frame_width=640, frame_height=360)
    points = np.asarray(fish.extras["points"])[-1]
    yield "fish", _lines(fish.frames[-1], points[:, None] + [[-4, 0], [4, 0]], closed=False)
    for name, closed in (("wires", False), ("leaves", True), ("walkers", True)):
        scene = scenes.make(name, num_frames=20)
        yield name, _lines(scene.frames[-1], scene.extras["outlines"][-1], closed=closed)
    for name in ("distracter", "projectiles"):
        scene = scenes.make(name, num_frames=6)
        yield name, media.draw_boxes(scene.frames[-1], scene.boxes[-1])


def _clouds():
    """The particles of every filter after some frames."""
    key = jax.random.key(0)
    size = {"frame_width": 180, "frame_height": 144}
    scene = scenes.make("distracter", num_objects=3, num_frames=10, frame_margin=4.0, **size)
    for method in ("sir", "ps", "dps", "sps", "labelled"):
        tracker = jaxpf.boxes.tracker(
            scene.frames[0], scene.boxes[0], method=method, appearance="colour"
        )
        state, _ = jaxpf.run(tracker, key, scene.frames[1:])
        yield f"filter-{method}", _dots(scene.frames[-1], state)
    fish = scenes.make("fish", num_frames=10, frame_width=640, frame_height=360)
    for method in ("eskil", "pffl"):
        tracker = jaxpf.points.tracker(fish.frames[0], fish.extras["points"][0], method=method)
        state, _ = jaxpf.run(tracker, key, fish.frames[1:])
        yield f"filter-{method}", _dots(fish.frames[-1], state)


def _dots(frame, state):
    """The frame, enlarged and faded, with a dot for every particle."""
    large = cv2.resize(frame, None, fx=2, fy=2, interpolation=cv2.INTER_AREA)
    large = np.uint8(255 - 0.3 * (255.0 - large))
    places = np.swapaxes(np.asarray(state.substates)[..., :2], 0, 1)
    return media.draw_particles(large, 2 * places)


def _lines(frame, lines, *, closed):
    """The frame with polylines ``[P, S, 2]`` drawn over it, enlarged."""
    large = cv2.resize(frame, None, fx=2, fy=2, interpolation=cv2.INTER_CUBIC)
    for line, colour in zip(lines, media.object_colours(len(lines)), strict=True):
        points = np.rint(2 * np.asarray(line)).astype(np.int32)
        cv2.polylines(large, [points], closed, [int(c) for c in colour], 2, cv2.LINE_AA)
    return large
