"""Options of pytest with which one run takes a part of the tests, and ends in time.

``--share HASH`` keeps the tests that are marked ``always``, those of changed code, but no more than
a third of all, and a third of the others.  The hash chooses both, so that each commit has others,
and whole files where those are small.  ``--changed-since REV`` names the commit since which code
has changed.
``JAXPF_TESTS_UNTIL``, in seconds since 1970, is when no further test begins; those that did not run
are named, and do not fail the run.
"""

import hashlib
import os
import re
import subprocess
import time
from collections import Counter
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
UNTIL = "JAXPF_TESTS_UNTIL"
SHARE = 1 / 3
#: Tests of a file go together, since they share what they compile, unless there are more of them;
#: then those of a function do, unless it has more cases.
_MANY = 20
#: Every filter stands on them, and the statistical tests are about filters.
_KERNEL = {"contract", "filters", "gradients", "lowering", "ordering", "proposals", "resampling"}
_NOT_RUN = "not run: the time was up"


def pytest_addoption(parser):
    parser.addoption("--share", metavar="HASH", help="tests of changed code, a third of the others")
    parser.addoption("--changed-since", metavar="REV", help="the commit that --share compares with")


def beginnings(config):
    """Where tests of changed code lie: everywhere, if no revision is named."""
    revision = config.option.changed_since
    return touched(changed_since(revision)) if revision else ("tests/",)


def pytest_report_header(config):
    if not config.option.share:
        return None
    where = " ".join(sorted(beginnings(config))) or "nothing"
    return f"share {config.option.share}, with tests of changed code first: {where}"


@pytest.hookimpl(trylast=True)  # after -m
def pytest_collection_modifyitems(config, items):
    if not (share := config.option.share):
        return
    by_name = {item.nodeid: item for item in items}
    always = [name for name, item in by_name.items() if item.get_closest_marker("always")]
    divided = [name for name in by_name if name not in always]
    parts = (always, *chosen(divided, beginnings(config), share))
    # xdist deals out one contiguous part to each worker: each begins with those.
    workers = getattr(config, "workerinput", {}).get("workercount", 1)
    order = [name for n in range(workers) for part in parts for name in cut(part, n, workers)]
    config.hook.pytest_deselected(items=[by_name[name] for name in by_name.keys() - {*order}])
    items[:] = [by_name[name] for name in order]


def cut(names, number, parts):
    """The part of this number, of so many contiguous ones of equal length."""
    return names[len(names) * number // parts : len(names) * (number + 1) // parts]


def changed_since(revision):
    """Files of the working tree that differ from a revision."""
    command = ["git", "-C", str(ROOT), "diff", "--name-only", revision]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()


def touched(changed):
    """Where tests of the changed files lie: beginnings of their paths."""
    where = set()
    for path in map(Path, changed):
        package, *folders = path.parts[:-1] or [path.name]
        if package in ("constraints.txt", "pyproject.toml"):
            where.add("tests/")
        elif package in ("scenes", "notebooks"):
            where.add(f"tests/{package}/")
        elif package == "tests" and folders == ["helpers"]:
            where |= users_of(path.stem)
        elif package == "tests":
            where.add(str(path))
        elif package == "jaxpf":
            if {*folders[:1], path.stem} & _KERNEL:
                where |= {"tests/filters/", "tests/statistical/"}
            while folders and not (ROOT / "tests" / Path(*folders)).is_dir():
                folders.pop()
            if folders:
                where.add(f"tests/{'/'.join(folders)}/")
    return tuple(where)


def users_of(helper):
    """Files of tests that import a helper."""
    named = re.compile(rf"^(?:from|import) {helper}\b", re.MULTILINE)
    files = [path for path in (ROOT / "tests").rglob("test_*.py") if named.search(path.read_text())]
    return {path.relative_to(ROOT).as_posix() for path in files}


def chosen(names, beginnings, share):
    """Tests of changed code, and of the others, that the hash chooses; in their order."""
    place = {name: number for number, name in enumerate(names)}
    groups = [(name.partition("::")[0], name.partition("[")[0]) for name in names]
    sizes = Counter(group for pair in groups for group in pair)

    def drawn(name):
        unit = next((g for g in groups[place[name]] if sizes[g] <= _MANY), name)
        return hashlib.sha256(f"{share} {unit}".encode()).digest(), place[name]

    changed = sorted((name for name in names if name.startswith(beginnings)), key=drawn)
    others = sorted((name for name in names if not name.startswith(beginnings)), key=drawn)
    first = changed[: round(SHARE * len(names))]
    rest = others[: round(SHARE * len(others))]
    return sorted(first, key=place.get), sorted(rest, key=place.get)


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item):
    if time.time() > float(os.environ.get(UNTIL, "inf")):
        pytest.skip(_NOT_RUN)


def pytest_report_teststatus(report):
    if report.skipped and isinstance(report.longrepr, tuple) and _NOT_RUN in report.longrepr[2]:
        return "not run", "-", "NOT RUN"
    return None


def pytest_terminal_summary(terminalreporter):
    not_run = terminalreporter.stats.get("not run", [])
    for name in sorted(report.nodeid for report in not_run):
        terminalreporter.write_line(f"NOT RUN {name}")
