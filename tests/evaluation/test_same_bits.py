"""Evaluations give the same bits however their work is divided."""

import subprocess
import sys
from pathlib import Path

import pytest
from small_evaluation import (
    HERE,
    RUNS,
    TWICE,
    assert_equal_bits,
    content,
    names,
    small_plan,
    small_scene,
)

from jaxpf.evaluation import Plan, Results, evaluate
from jaxpf.evaluation.engine import Pool
from jaxpf.evaluation.trackers import OwnTracker

#: A user's own files.
HOUSE = Path(__file__).parents[1] / "house"


@pytest.mark.slow
@pytest.mark.parametrize("runs", [7, 31])
def test_blocks_of_two_widths_are_the_same_together_and_apart(tmp_path, runs):
    plan = small_plan(runs=runs, methods=["dps"])
    together, apart = (
        evaluate(plan, tmp_path / name, runs_per_batch=size)
        for name, size in (("together", 1000), ("apart", 5))
    )
    assert len(names(together.folder)) < len(names(apart.folder))
    assert_equal_bits(content(together), content(apart))


@pytest.mark.slow
def test_dask_gives_the_same_bits(whole, tmp_path):
    distributed = pytest.importorskip(
        "distributed", reason="needs Dask: pip install jaxpf[cluster]"
    )
    from jaxpf.cli.shared.startup import use_compile_cache

    # A user's tracker travels as its file's text: the file may be gone on the other machine.
    file = tmp_path / "own.py"
    file.write_text((HOUSE / "own_likelihood.py").read_text())
    plan = small_plan(runs=TWICE, trackers={"own": OwnTracker.read(f"{file}:centre_colour")})
    file.unlink()
    with (
        distributed.LocalCluster(
            n_workers=1, threads_per_worker=2, processes=True, dashboard_address=None
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        client.run(use_compile_cache)
        results = evaluate(
            plan, tmp_path / "there", runs_per_batch=RUNS, pool=Pool(client.get_executor, 2)
        )
    alone = Plan(small_scene, methods=(), runs=TWICE, trackers=plan.trackers)
    here = evaluate(alone, tmp_path / "here", runs_per_batch=RUNS)
    built_in, own = 2, content(here)
    there = content(results)
    assert_equal_bits({of: there[of] for of in there if of[0] < built_in}, content(whole))
    assert_equal_bits({(0, name): there[i, name] for i, name in there if i == built_in}, own)


@pytest.mark.slow
@pytest.mark.parametrize("devices", [1, 2])
def test_the_number_of_devices_does_not_matter(whole, tmp_path, devices):
    code = f"""
import jax
jax.config.update("jax_num_cpu_devices", {devices})
from jaxpf.cli.shared.startup import use_compile_cache
use_compile_cache()
from jaxpf.evaluation import evaluate
from small_evaluation import small_plan
assert jax.device_count() == {devices}
evaluate(small_plan(runs={TWICE}), {str(tmp_path)!r})
"""
    subprocess.run([sys.executable, "-c", code], cwd=HERE, check=True)
    assert_equal_bits(content(Results.open(tmp_path)), content(whole))
