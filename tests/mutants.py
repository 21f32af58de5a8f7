"""Plant known faults, one at a time, in a copy of the project: the quick tests must notice each.

Run it by hand before a release; it takes about half an hour::

    python tests/mutants.py                     # all faults
    python tests/mutants.py pmmh smc2-prior     # those whose names begin so
    python tests/mutants.py --from smc2-prior   # go on there, after an interruption

A fault replaces a text that stands once in its file.  The exit code is 1 if a fault survives, its
text is not found exactly once, or its tests fail without it.  Faults that tests in
``tests/statistical`` plant themselves are not repeated here.
"""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]


class Mutant(NamedTuple):
    """A fault: ``old`` becomes ``new`` in a file of ``jaxpf``; ``tests`` are pytest's arguments."""

    name: str
    file: str
    old: str
    new: str
    tests: str


def of(file: str, tests: str, *faults: tuple[str, str, str]) -> Iterator[Mutant]:
    """Faults ``(name, old, new)`` of one file, and the tests that must notice them."""
    return (Mutant(name, file, old, new, tests) for name, old, new in faults)


_SMOOTHING = "tests/smoothing/test_unequal_weights.py -k {}"

MUTANTS = (
    *of(
        "running/simulation.py", "tests/running/test_simulation.py -k rows_of_its_frames",
        ("simulate-equal-weights", "state.log_weights, shape", "0 * state.log_weights, shape"),
        ("simulate-first-rows", "calls.time_of(state)\n", "0\n"),
        ("simulate-time", "else state.time) +", "else state.time - 1) +"),
        ("simulate-other-particle", "_of_particle(state, chosen)", "_of_particle(state, 0)"),
    ),
    *of(
        "likelihoods/gaussian.py", "tests/likelihoods/test_gaussian.py -k gaussian",
        ("gaussian-sample-transposed", "pef,pf->pe\", noise, drawn", "pfe,pf->pe\", noise, drawn"),
        ("gaussian-sample-noise", "\"pef,pf->pe\", noise,", "\"pef,pf->pe\", 1.05 * noise,"),
        ("gaussian-density", "-0.5 * squares", "-0.525 * squares"),
    ),
    *of(
        "tuning/metropolis.py", "tests/tuning/test_exact.py -k pmmh",
        ("pmmh-prior", "proposed.log_prior - chains.log_prior",
         "0.95 * (proposed.log_prior - chains.log_prior)"),
        ("pmmh-evidence", "change += sum_evenly(", "change += 0.95 * sum_evenly("),
        ("pmmh-one-first-key", "init(tracker, keys[0])", "init(tracker, jax.random.key(0))"),
        ("pmmh-paths-by-chance", "*ancestry, state", "*ancestry, 0 * state"),
        ("pmmh-frames-late", "jnp.arange(len(path)), path)", "1 + jnp.arange(len(path)), path)"),
    ),
    *of(
        "tuning/metropolis.py", "tests/tuning/test_metropolis.py -k prior_alone",
        ("pmmh-keys-stay", ".set(keys[2:])", ".set(chains.keys[:, block])"),
    ),
    *of(
        "tuning/smc2.py", "tests/tuning/test_exact.py -k smc2",
        ("smc2-prior", "prior(new) - prior(draws.place)",
         "0.9 * (prior(new) - prior(draws.place))"),
        ("smc2-evidence-of-moves", "proposed.log_evidence - draws.log_evidence",
         "0.95 * (proposed.log_evidence - draws.log_evidence)"),
        ("smc2-weights", "(log_weights, increments)", "(log_weights, 0.95 * increments)"),
        ("smc2-weights-stay", "jnp.full_like(log_weights, -np.log(num_draws))", "log_weights"),
        ("smc2-not-resampled", "ancestors(select_key, log_weights)", "jnp.arange(num_draws)"),
        ("smc2-fewer-frames", "0, time + 1, lambda", "0, time, lambda"),
        ("smc2-old-evidence", "states=states, log_evidence=log_evidence)", "states=states)"),
        ("smc2-mean", "draws.place.T, weights", "draws.place.T, weights**0 / num_draws"),
    ),
    *of(
        "smoothing/backward.py", _SMOOTHING.format("backward"),
        ("backward-weights", "log_weights + log_moves, -", "0.95 * log_weights + log_moves, -"),
        ("backward-frame-late", "for step in (1, 2)", "for step in (0, 1)"),
        ("backward-previous", "(log_prob - largest)", "0.95 * (log_prob - largest)"),
        ("backward-previous-frame", "(self.observations, self.time)",
         "(self.observations, self.time - 1)"),
    ),
    *of(
        "smoothing/backward.py", _SMOOTHING.format("metropolis"),
        ("metropolis-accepts", "log_other - log_moves", "0.9 * (log_other - log_moves)"),
        ("metropolis-begins-elsewhere", "origin = sources[parts[0], index]", "origin = index"),
    ),
    *of(
        "smoothing/backward.py", _SMOOTHING.format("genealogy"),
        ("genealogy-counts-all", "max(weights > 0)", "max(weights >= 0)"),
        ("genealogy-weights", "jnp.exp(log_weights)", "jax.nn.softmax(0.95 * log_weights)"),
        ("genealogy-frame-late", "jnp.take_along_axis(sources, index, axis=-1), of", "index, of"),
    ),
    *of(
        "smoothing/gibbs.py", _SMOOTHING.format("sweep"),
        ("gibbs-frame-late", "frames_left, time - 1", "frames_left, time"),
        ("gibbs-moves-early", "at_frame(model, time)", "at_frame(model, time - 1)"),
        ("gibbs-weights", "moves = state.log_weights +", "moves = 0 * state.log_weights +"),
        ("gibbs-end-by-chance", "*history, state", "*history, 0.95 * state"),
    ),
    *of(
        "tuning/objectives.py", "tests/tuning/test_objectives.py -k losses_are",
        ("crps", "jnp.sum(scores, axis", "1.05 * jnp.sum(scores, axis"),
        ("position-error", "jnp.sum(distance, axis", "1.05 * jnp.sum(distance, axis"),
        ("iou-loss", "1 - iou, 0.0", "1 - 0.95 * iou, 0.0"),
    ),
    *of(
        "running/missing_frames.py", "tests/running/test_missing_frames.py -k however_small",
        ("gap-rounding", "_ROUNDING = 1000", "_ROUNDING = 1_000_000"),
    ),
    *of(
        "filters/uncertainty/side_by_side.py",
        "tests/filters/uncertainty/test_side_by_side.py -k few_runs",
        ("side-by-side-estimates", "x / (num_runs - 1)", "x / num_runs"),
        ("side-by-side-evidence", "log_shares)) / (num_runs - 1)", "log_shares)) / num_runs"),
    ),
    *of(
        "filters/uncertainty/error_bars.py", "tests/filters/uncertainty/test_error_bars.py",
        ("error-bars-generations", "rate * looked_back", "rate * (looked_back - 1)"),
    ),
    *of(
        "filters/partitioned/selection.py", "tests/filters/test_auxiliary.py",
        ("auxiliary-called-equal", "equal=equal | ~state.weighted", "equal=jnp.ones((), bool)"),
        ("auxiliary-weights-equal", "equal &= log_first_stage is None", "equal &= True"),
    ),
    *of(
        "dynamics/gaussian.py", "tests/dynamics/test_dynamics.py",
        ("ar2-momentum", "asarray(self.momentum,", "asarray(0.95 * self.momentum,"),
        ("normal-density", "- jnp.log(scale)", "- 0.95 * jnp.log(scale)"),
        ("linear-density-volume", "jnp.ones_like(normal)) - volume", "jnp.ones_like(normal))"),
        ("linear-noise-transposed", "+ _apply(self.noise, partition, noise)",
         "+ _apply(jnp.swapaxes(self.noise, 1, 2), partition, noise)"),
    ),
    *of(
        "proposals.py", "tests/filters/test_proposals.py -k density",
        ("mixture-share", "jnp.log1p(-share)", "jnp.log1p(-0.95 * share)"),
        ("normal-proposal-volume", "+ of_partition(volume", "+ 0.95 * of_partition(volume"),
    ),
    *of(
        "filters/labelled/kernel.py", "tests/filters/test_labelled.py",
        ("label-evidence", "total - jnp.where(alive, before, 0.0)", "total"),
        ("label-ess", "1.0 / jnp.where(present", "0.95 / jnp.where(present"),
    ),
    *of(
        "likelihoods/pixels.py", "tests/likelihoods/test_pixels.py",
        ("pixels-product", "jax.nn.logsumexp(log_pixel, axis=1)", "jnp.sum(log_pixel, axis=1)"),
    ),
    *of(
        "likelihoods/contours/line_model.py", "tests/likelihoods/contours/test_line_model.py",
        ("line-model-one-edge-twice", "total + blocks[number ^", "total + totals[number ^"),
    ),
    *of(
        "measures/calibration.py", "tests/measures/test_calibration.py",
        ("crps-measure", "2 * density - 1", "1.9 * density - 1"),
    ),
)  # fmt: skip


def passes(folder: Path, tests: str) -> bool | None:
    """Whether the quick ones of the tests pass in a copy; None if they cannot be run."""
    command = [sys.executable, "-B", "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider"]
    code = subprocess.run(
        [*command, "-m", "not slow", *tests.split()],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1"},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        check=False,
    ).returncode
    return {0: True, 1: False}.get(code)


def verdict(folder: Path, mutant: Mutant) -> str:
    """Plant a fault in a copy, run its tests, and take it out again."""
    path = folder / "jaxpf" / mutant.file
    right = path.read_text()
    if (count := right.count(mutant.old)) != 1:
        return f"not planted: the text {mutant.old!r} stands {count} times in {mutant.file}"
    try:
        path.write_text(right.replace(mutant.old, mutant.new))
        compile(path.read_text(), path, "exec")
        found = passes(folder, mutant.tests)
    finally:
        path.write_text(right)
    return {True: "SURVIVED", False: "killed"}.get(found, "not judged: no test ran")


def main() -> int:
    """Run the chosen faults and return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", help="faults, or how their names begin; default all")
    parser.add_argument("--from", dest="first", help="the first fault to run")
    given = parser.parse_args()
    names = [mutant.name for mutant in MUTANTS]
    first = names.index(given.first) if given.first else 0
    begin = tuple(given.names) or ("",)
    chosen = [mutant for mutant in MUTANTS[first:] if mutant.name.startswith(begin)]
    if not chosen:
        parser.error(f"no fault is called so; there are {', '.join(names)}")
    ends, checked = [], {}
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch, "copy")
        unwanted = shutil.ignore_patterns(".*", "__pycache__", "_build", "build", "dist")
        shutil.copytree(ROOT, folder, ignore=unwanted)
        for number, mutant in enumerate(chosen, 1):
            if mutant.tests not in checked:
                checked[mutant.tests] = passes(folder, mutant.tests)
            is_right = checked[mutant.tests]
            end = verdict(folder, mutant) if is_right else "not judged: its tests fail without it"
            ends.append(end)
            print(f"{number:3}/{len(chosen)} {mutant.name}: {end}", flush=True)
    print(f"{ends.count('killed')} of {len(ends)} killed")
    return int(ends != ["killed"] * len(ends))


if __name__ == "__main__":
    sys.exit(main())
