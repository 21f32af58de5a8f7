"""Options of pytest with which one run takes a part of the tests, and ends in time.

``--sixth N`` keeps the tests that are marked ``always``, those of one sixth, and then those of
changed code.  A name decides its sixth, so that six numbers in a row run every test; whole files
stay together where those are small, since they share what they compile.  ``--changed-since REV``
names the commit since which code has changed.
``JAXPF_TESTS_UNTIL``, in seconds since 1970, is when no further test begins, and
``JAXPF_CHANGED_UNTIL`` the same for those that changed code alone selects; those that did not run
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
CHANGED_UNTIL = "JAXPF_CHANGED_UNTIL"
SIXTHS = 6
#: Tests of a file go together, since they share what they compile, unless there are more of them;
#: then those of a function do, unless it has more cases.
_MANY = 20
#: Every filter stands on them, and the statistical tests are about filters.
_KERNEL = {"contract", "filters", "gradients", "lowering", "ordering", "proposals", "resampling"}
_NOT_RUN = "not run: the time was up"


_changed_only = pytest.StashKey[bool]()


def pytest_addoption(parser):
    parser.addoption(
        "--sixth", type=int, metavar="N", help="tests of one sixth, then of changed code"
    )
    parser.addoption("--changed-since", metavar="REV", help="the commit that --sixth compares with")


def beginnings(config):
    """Where tests of changed code lie: nowhere, if no revision is named."""
    revision = config.option.changed_since
    return touched(changed_since(revision)) if revision else ()


def pytest_report_header(config):
    if config.option.sixth is None:
        return None
    where = " ".join(sorted(beginnings(config))) or "nothing"
    return f"sixth {config.option.sixth % SIXTHS} of 0 to 5, then tests of changed code: {where}"


@pytest.hookimpl(trylast=True)  # after -m
def pytest_collection_modifyitems(config, items):
    if (number := config.option.sixth) is None:
        return
    by_name = {item.nodeid: item for item in items}
    always = [name for name, item in by_name.items() if item.get_closest_marker("always")]
    divided = [name for name in by_name if name not in always]
    sixth, changed = chosen(divided, beginnings(config), number)
    for name in changed:
        by_name[name].stash[_changed_only] = True
    # xdist deals out one contiguous part to each worker: each begins with those.
    workers = getattr(config, "workerinput", {}).get("workercount", 1)
    parts = (always, sixth, changed)
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


def chosen(names, beginnings, number):
    """The tests of a sixth, and the others of changed code; in their order."""
    groups = [(name.partition("::")[0], name.partition("[")[0]) for name in names]
    sizes = Counter(group for pair in groups for group in pair)

    def is_drawn(name, pair):
        unit = next((group for group in pair if sizes[group] <= _MANY), name)
        return hashlib.sha256(unit.encode()).digest()[0] % SIXTHS == number % SIXTHS

    sixth = [name for name, pair in zip(names, groups, strict=True) if is_drawn(name, pair)]
    others = [name for name in names if name not in {*sixth} and name.startswith(beginnings)]
    return sixth, others


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item):
    limit = CHANGED_UNTIL if item.stash.get(_changed_only, False) else UNTIL
    if time.time() > float(os.environ.get(limit, "inf")):
        pytest.skip(_NOT_RUN)


def pytest_report_teststatus(report):
    if report.skipped and isinstance(report.longrepr, tuple) and _NOT_RUN in report.longrepr[2]:
        return "not run", "-", "NOT RUN"
    return None


def pytest_terminal_summary(terminalreporter):
    not_run = terminalreporter.stats.get("not run", [])
    for name in sorted(report.nodeid for report in not_run):
        terminalreporter.write_line(f"NOT RUN {name}")
