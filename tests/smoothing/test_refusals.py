"""What cannot be smoothed, and what is named: one row for each rule."""

from functools import partial

import jax
import numpy as np
from models import partitioned, walks
from refusals import every, message_of
from unsuited_dynamics import Blind

import jaxpf
from jaxpf import ordering, smoothing
from jaxpf.dynamics import AR2
from jaxpf.gradients import Transport
from jaxpf.smoothing.checks import check_smoothing

KEY = jax.random.key(0)
FRAMES = np.zeros((5, 2, 1), np.float32)
tracker = partial(partitioned, dynamics=AR2(scale=1.0))


def forest(**changes):
    parents = (-1, -1, 0, 1)
    return tracker(ordering.sps(parents, **changes), parents=parents)


def smooth(its=None, frames=FRAMES, **options):
    return jaxpf.smooth(tracker() if its is None else its, KEY, frames, **options)


def sweeps(number=2, reference=None, order=None, **changes):
    its = tracker(order, **{"resampling": "multinomial", "num_particles": 6} | changes)
    return smoothing.particle_gibbs(its, KEY, FRAMES, number, reference)


@every([
    (lambda: smooth(tracker(dynamics=Blind())), "log_density"),
    (lambda: smooth(tracker(gradient=Transport(), keep_ancestors=True)), "gradient Transport"),
    (lambda: smooth(tracker(ordering.sps([-1, -1], "sorted"))), "swap='sorted'"),
    (lambda: smooth(forest()), "exchanges roots"),
    (lambda: smooth(jaxpf.PFFL(**walks())), "PFFL"),
    (lambda: smooth(num_trajectories=0), "num_trajectories = 0"),
    (lambda: smooth(lag=0), "lag = 0"),
    (lambda: smooth(lag=2, paths=3), "leave out one"),
    (lambda: smooth(lag=2, method="genealogy"), "leave out one"),
    (lambda: smooth(num_trajectories=2, paths=3), "paths=3"),
    (lambda: smooth(num_trajectories=2, method="genealogy"), "all particles"),
    (lambda: smooth(method="metropolis", num_steps=0), "num_steps = 0"),
    (lambda: smooth(method="ancestry"), "backward, metropolis, genealogy"),
    (lambda: smooth(frames=iter(FRAMES)), "lag"),
    (lambda: smooth(frames=iter(()), lag=2), "no frame"),
    (lambda: sweeps(resampling="systematic"), "resampling='multinomial'"),
    (lambda: sweeps(order=ordering.sps([-1, -1])), "jaxpf.ordering.ps or sir"),
    (lambda: sweeps(order=ordering.dps(2)), "jaxpf.ordering.ps or sir"),
    (lambda: sweeps(ess_threshold=0.5), "ess_threshold"),
    (lambda: sweeps(dynamics=Blind()), "log_density"),
    (lambda: sweeps(reference=np.zeros((5, 2, 1))), "[6, 2, 1]"),
    (lambda: sweeps(0), "num_sweeps = 0"),
])  # fmt: skip
def test_what_cannot_be_smoothed_is_refused(call, named):
    assert named in message_of(call)


def test_roots_that_stay_can_be_smoothed():
    check_smoothing(forest(exchange_roots=False))
    check_smoothing(forest(swap="none"))
