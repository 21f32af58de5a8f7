"""What cannot be smoothed, and what is named: one row for each rule."""

import jax
import jax.numpy as jnp
import numpy as np
from refusals import every, message_of
from unsuited_dynamics import Blind

import jaxpf
from jaxpf import ordering, smoothing
from jaxpf.dynamics import AR2
from jaxpf.gradients import Transport
from jaxpf.likelihoods import Gaussian
from jaxpf.running import memory

KEY = jax.random.key(0)
FRAMES = np.zeros((5, 2, 1), np.float32)
MODEL = {
    "dynamics": AR2(scale=1.0),
    "likelihood": Gaussian(noise=jnp.ones((2, 1, 1))),
    "initial": jnp.zeros((2, 1)),
}


def tracker(order=None, **changes):
    order = ordering.ps([1, 0]) if order is None else order
    return jaxpf.Partitioned(**{"ordering": order, "num_particles": 30} | MODEL | changes)


def forest(**changes):
    parents = (-1, -1, 0, 1)
    noise, start = np.ones((4, 1, 1)), np.zeros((4, 1))
    order = ordering.sps(parents, **changes)
    return tracker(order, parents=parents, initial=start, likelihood=Gaussian(noise))


def smooth(its=None, frames=FRAMES, **options):
    return jaxpf.smooth(tracker() if its is None else its, KEY, frames, **options)


def sweeps(number=2, reference=None, order=None, **changes):
    its = tracker(order, **{"resampling": "multinomial", "num_particles": 6} | changes)
    return smoothing.particle_gibbs(its, KEY, FRAMES, number, reference)


@every([
    (lambda: smooth(tracker(dynamics=Blind())), "add the method log_density"),
    (lambda: smooth(tracker(gradient=Transport())), "Transport blends particles"),
    (lambda: smooth(tracker(gradient=Transport(), keep_ancestors=True)), "gradient Transport"),
    (lambda: smooth(tracker(ordering.sps([-1, -1], "sorted"))), "swap='sorted'"),
    (lambda: smooth(forest()), "exchanges roots that have children"),
    (lambda: smooth(jaxpf.PFFL(**MODEL)), "PFFL cannot be smoothed"),
    (lambda: smooth(num_trajectories=0), "num_trajectories = 0"),
    (lambda: smooth(lag=0), "lag = 0"),
    (lambda: smooth(lag=2, paths=3), "leave out one of the two"),
    (lambda: smooth(lag=2, method="genealogy"), "leave out one of the two"),
    (lambda: smooth(num_trajectories=2, paths=3), "paths=3 are more"),
    (lambda: smooth(num_trajectories=2, method="genealogy"), "traces all particles"),
    (lambda: smooth(method="metropolis", num_steps=0), "num_steps = 0"),
    (lambda: smooth(method="ancestry"), "backward, metropolis, genealogy"),
    (lambda: smooth(frames=iter(FRAMES)), "give a lag"),
    (lambda: smooth(frames=iter(()), lag=2), "no frame"),
    (lambda: smoothing.LookBack(tracker(), KEY, num_frames=2 * 10**9), "--smooth-lag 50"),
    (lambda: sweeps(resampling="systematic"), "not for systematic; give resampling='multinomial'"),
    (lambda: sweeps(order=ordering.sps([-1, -1])), "use jaxpf.ordering.ps or sir"),
    (lambda: sweeps(order=ordering.dps(2)), "use jaxpf.ordering.ps or sir"),
    (lambda: sweeps(ess_threshold=0.5), "ess_threshold; leave it out"),
    (lambda: sweeps(dynamics=Blind()), "add the method log_density"),
    (lambda: sweeps(reference=np.zeros((5, 2, 1))), "[5, 2, 1] instead of [6, 2, 1]"),
    (lambda: sweeps(0), "num_sweeps = 0"),
])  # fmt: skip
def test_what_cannot_be_smoothed_is_refused(call, named):
    assert named in message_of(call)


def test_roots_that_stay_can_be_smoothed():
    smoothing.check_smoothing(forest(exchange_roots=False))
    smoothing.check_smoothing(forest(swap="none"))


def test_a_clip_too_long_for_the_memory_names_the_fixed_lag(monkeypatch):
    monkeypatch.setattr(memory, "machine_memory", lambda: 2**10)
    assert "fixed lag, such as jaxpf.smooth(..., lag=50)" in message_of(smooth)
