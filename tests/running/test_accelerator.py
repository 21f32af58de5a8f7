"""What changes on a GPU, tried on a CPU that takes itself for one."""

import re

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from models import partitioned, space

import jaxpf
from jaxpf import ordering
from jaxpf.likelihoods import Gaussian
from jaxpf.lowering import platform
from jaxpf.running import blocks
from jaxpf.running.blocks import blocks_of
from jaxpf.running.runs import run_compiled, summary_only

Y = np.random.default_rng(0).normal(size=(4,)).astype(np.float32)
KEYS = jax.random.split(jax.random.key(0), 7)


def model():
    return space(num_particles=20)


@pytest.fixture(scope="module", autouse=True)
def accelerator():
    jax.clear_caches()  # programs in the other form
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(platform, "on_accelerator", lambda: True)
        yield
    jax.clear_caches()


@pytest.fixture
def no_accelerator(monkeypatch):
    """Call it to go on without."""

    def leave():
        jax.clear_caches()
        monkeypatch.setattr(platform, "on_accelerator", lambda: False)

    yield leave
    jax.clear_caches()


@pytest.fixture
def widths(monkeypatch):
    """Widths of the blocks in which first chunks are advanced; those above 3 run out of memory."""
    tried = []
    compiled = blocks._advance_compiled

    def limited(tracker, batches, *arguments):
        tried.append([batch.shape for batch in batches])
        if max(width for _, width in tried[-1]) > 3:
            raise jax.errors.JaxRuntimeError("RESOURCE_EXHAUSTED: out of memory")
        return compiled(tracker, batches, *arguments)

    monkeypatch.setattr(blocks, "_advance_compiled", limited)
    return tried


@pytest.mark.slow
def test_a_block_is_halved_when_memory_runs_out(widths):
    found = jaxpf.monte_carlo(model(), KEYS, iter(Y), frames_per_chunk=2)
    assert widths[:3] == [[(1, 7)], [(3, 3)], [(3, 3)]]  # the second chunk needs no attempt
    assert len(widths) == 3
    assert found.estimate.shape == (7, 4, 1, 1)
    narrow = jaxpf.monte_carlo(model(), KEYS, Y, batch_size=3)
    np.testing.assert_allclose(found.estimate, narrow.estimate, atol=1e-5)
    with pytest.raises(jax.errors.JaxRuntimeError, match="RESOURCE_EXHAUSTED"):
        jaxpf.monte_carlo(model(), KEYS, Y, batch_size=7)


@pytest.mark.slow
@pytest.mark.always
def test_one_block_gives_the_results_of_many_to_rounding(no_accelerator):
    wide = jaxpf.monte_carlo(model(), KEYS, Y)
    assert blocks_of(1000) == ((1, 1000),)
    assert blocks_of(3000) == ((3, 1000),)
    no_accelerator()
    assert blocks_of(7) == ((1, 5), (1, 2))
    narrow = jaxpf.monte_carlo(model(), KEYS, Y)
    np.testing.assert_allclose(wide.estimate, narrow.estimate, atol=1e-5)
    np.testing.assert_allclose(wide.log_evidence, narrow.log_evidence, atol=1e-5)


@jaxpf.pytree_dataclass
class Nearby(Gaussian):
    """Impossible where it is less likely than ``least``: many particles may have no weight."""

    least: float = -np.inf

    def log_prob_all(self, observation, partition, substates):
        log_prob = super().log_prob_all(observation, partition, substates)
        return jnp.where(log_prob > self.least, log_prob, -jnp.inf)


ORDERS = {"dps": ordering.dps(3), "sps": ordering.sps(num_partitions=3)}


def parts(order=ORDERS["dps"], least=-np.inf):
    """Three partitions, each resampled, so that every form with components is used."""
    likelihood = Nearby(noise=np.ones((3, 1, 1), np.float32), least=np.float32(least))
    return partitioned(order, likelihood=likelihood)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["dps", pytest.param("sps", marks=pytest.mark.always)])
def test_both_forms_give_the_same_results(name, no_accelerator):
    """Where all particles have weight, and where many have none."""
    frames = np.stack([Y, -Y, 2 * Y], axis=1)[:2, :, None]

    def results():
        given = (parts(ORDERS[name], least) for least in (-np.inf, -1.5))
        return [jax.device_get(jaxpf.run(each, KEYS[0], frames)) for each in given]

    ours = results()
    no_accelerator()
    for (one, told), (other, said) in zip(ours, results(), strict=True):
        np.testing.assert_array_equal(one.lineage, other.lineage)
        np.testing.assert_array_equal(told.distinct_share, said.distinct_share)
        np.testing.assert_allclose(one.substates, other.substates, atol=1e-6)
        np.testing.assert_allclose(told.log_evidence, said.log_evidence, atol=1e-5)
        assert said.distinct_share.min() < 1  # resampled inside the frame


@pytest.mark.parametrize("scheme", ["systematic", "stratified", "multinomial", "residual"])
def test_a_particle_of_zero_weight_has_no_offspring_in_either_form(scheme, no_accelerator):
    generator = np.random.default_rng(1)
    weights = generator.exponential(size=3000) * (generator.random(3000) < 0.3)
    with np.errstate(divide="ignore"):
        log_weights = np.log(weights).astype(np.float32)

    def drawn():
        draw = jax.jit(lambda key, weights: jaxpf.resampling.ancestors(key, weights, scheme))
        return draw(KEYS[0], log_weights)

    found = [drawn()]
    no_accelerator()
    found.append(drawn())
    for ancestors in found:
        assert weights[ancestors].min() > 0
    if scheme == "systematic":
        expected = 3000 * weights / weights.sum()
        for ancestors in found:
            assert (abs(np.bincount(ancestors, minlength=3000) - expected) < 1 + 1e-3).all()


def turned(key, x, p):
    return p @ x + jax.random.normal(key, (2,))


def test_products_are_as_precise_as_their_factors():
    """Those of a model's functions too; JAX's default on a GPU keeps ten bits."""
    tracker = jaxpf.state_space(
        initial=lambda key, p: jax.random.normal(key, (2,)),
        transition=turned,
        log_likelihood=lambda y, x, p: -0.5 * jnp.sum((y - x) ** 2),
        parameters=np.eye(2, dtype=np.float32),
        num_particles=20,
    )

    def precisions():
        lowered = run_compiled.trace(tracker, KEYS[0], Y, summary_only).lower()
        return set(re.findall(r"dot_general.*precision = \[(\w+), ", lowered.as_text()))

    assert precisions() == {"HIGHEST"}
    with jax.default_matmul_precision("high"):  # the user's wish
        assert precisions() == {"HIGH"}


@pytest.mark.parametrize(("make", "most"), [(model, (0, 1)), (parts, (6, 3))])
def test_few_branches_and_loops_are_left(make, most):
    """Loops over frames, partitions and levels remain, and branches that save much work."""
    frames = Y[:, None, None] * np.ones((3, 1), np.float32) if make is parts else Y
    lowered = run_compiled.trace(make(), KEYS[0], frames, summary_only).lower(
        lowering_platforms=("cuda",)
    )
    text = lowered.as_text()
    branches = len(re.findall(r"stablehlo\.(?:case|if)\b", text))
    assert (branches, len(re.findall(r"stablehlo\.while\b", text))) == most
