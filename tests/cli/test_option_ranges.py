"""What lies outside its declared range is refused by every command, in one line with both."""

import math

import click
from command_line import jaxpf

from jaxpf import cli
from jaxpf.cli.evaluating.request import Work
from jaxpf.cli.tracking.request import OF_BOXES, Run
from jaxpf.cli.tuning.command import Options as Tuning
from jaxpf.contract import Option
from jaxpf.contract.numbers import plain
from jaxpf.contract.options import options_of
from jaxpf.detections import Rules
from jaxpf.filters.registry import all_filters
from jaxpf.targets.registry import all_targets


def outside(option: Option):
    """Values just outside the declared range, as they are typed."""
    if option.choices:
        yield "best"
        return
    wrong = [edge + step for edge, step in ((option.least, -1), (option.most, 1))]
    wrong = [option.kind(value) for value in [*wrong, option.above] if math.isfinite(value)]
    wrong += [math.nan] if wrong and option.kind is float else []
    for value in wrong:
        yield plain([value, *[1] * (option.length - 1)] if option.length else value)


def method_of(option: Option, family) -> str:
    """A method to which the option applies."""
    return option.needs[1] if option.needs[:1] == ("method",) else family.methods[0]


def every_refusal(tmp_path):
    """(arguments without the wrong value, option) of ``track``, ``evaluate`` and ``tune``."""
    (tmp_path / "det.txt").write_text("1,-1,1,1,9,9,1\n")
    for name, target in all_targets().items():
        track, evaluate = ("track", name, "nowhere.mp4"), ("evaluate", "nowhere", "--target", name)
        run = options_of(Run)
        for option in [run[n] for n in run if target.has_boxes or n not in OF_BOXES]:
            yield track, option
        for option in options_of(target.tracker).values():
            yield track, option
            yield evaluate, option
    for family in all_filters().values():
        for option in options_of(family.build).values():
            if option.name == "method":
                yield ("track", "nowhere.mp4"), option
                continue
            method = method_of(option, family)
            yield ("track", "nowhere.mp4", "--method", method), option
            if option.name not in family.varied:
                yield ("evaluate", "nowhere", "--methods", method), option
    for option in options_of(Rules).values():
        yield ("track", "nowhere.mp4", "--detections", "det.txt"), option
    for option in options_of(Work).values():
        yield ("evaluate", "nowhere"), option
    for option in options_of(Tuning).values():
        yield ("tune", "nowhere"), option


def test_a_value_outside_its_range_is_refused_with_the_option_and_the_range(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    seen = set()
    for arguments, option in every_refusal(tmp_path):
        for value in outside(option):
            words = option.flag.split()
            asked = (*arguments, words[0], f"{words[1]}={value}" if option.rare else value)
            outcome = jaxpf(*asked)
            assert (outcome.code, outcome.out) == (2, ""), asked
            assert outcome.err.startswith("Error: "), (asked, outcome.err)
            assert outcome.err.count("\n") == 1, (asked, outcome.err)
            assert option.flag.removeprefix("--") in outcome.err, (asked, outcome.err)
            counted = ["counts from 1"] if option.places else [option.wanted]
            for wanted in option.choices or counted:
                assert wanted in outcome.err, (asked, outcome.err)
            seen.add((arguments[0], option.name))
    assert len(seen) > 90
    assert [path.name for path in tmp_path.iterdir()] == ["det.txt"], "nothing was begun"


def commands(group=cli.group, path=()):
    """(words, command) of every command and subcommand."""
    for name in group.list_commands(None):
        command = group.get_command(None, name)
        if isinstance(command, click.Group):
            yield from commands(command, (*path, name))
        else:
            yield (*path, name), command


def test_whole_numbers_of_the_small_commands_have_their_ranges(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    seen = 0
    for words, command in commands():
        for param in command.params:
            if not isinstance(param.type, click.IntRange):
                continue
            for value in (param.type.min - 1, param.type.max + 1, "x"):
                outcome = jaxpf(*words, param.opts[0], value)
                assert outcome.code == 2
                assert outcome.err.startswith(f"Error: Invalid value for '{param.opts[0]}'")
                bounds = f"is not in the range {param.type.min}<=x<={param.type.max}"
                assert value == "x" or bounds in outcome.err, outcome.err
                assert outcome.err.count("\n") == 1
                seen += 1
    assert seen > 20
    assert "--num-particles 0 must be a whole number from 1" in jaxpf("demo", "-n", 0).err
    assert not list(tmp_path.iterdir())


def test_no_two_options_of_a_command_have_one_name_and_every_option_has_help():
    for words, command in commands():
        spellings = [spelling for param in command.params for spelling in param.opts]
        assert len(set(spellings)) == len(spellings), words
        assert len({param.name for param in command.params}) == len(command.params), words
        for param in command.params:
            assert isinstance(param, click.Argument) or param.help, (words, param.name)
