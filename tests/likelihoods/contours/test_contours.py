"""Likelihoods of contours on drawn pictures: edges, crossings, exclusion, occlusion, refusals."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxpf.likelihoods import EdgeDetector, contours, poisson_clutter
from jaxpf.likelihoods.contours.build import learn_clutter
from jaxpf.likelihoods.contours.crossings import Polyline, first, is_inside, nearest_crossings
from jaxpf.likelihoods.contours.edges import Lines
from jaxpf.shapes import space_of

WIDTH, HEIGHT = 200, 160
DETECTOR = EdgeDetector(threshold=8.0)
FAR_SIGHTED = dataclasses.replace(DETECTOR, length=101)


def square(x, y, half=30.0):
    """Control points of a closed square with straight sides, four to each side, clockwise."""
    step = np.arange(4) * half / 2 - half
    top = np.stack([step, np.full(4, -half)], axis=1)
    sides = [top @ np.array([[c, s], [-s, c]]) for c, s in ((1, 0), (0, 1), (-1, 0), (0, -1))]
    return np.concatenate(sides) + np.array([x, y])


def picture(*centres, half=30, grey=40, ground=200):
    frame = np.full((HEIGHT, WIDTH, 3), ground, np.uint8)
    for x, y in centres:
        frame[y - half : y + half, x - half : x + half] = grey
    return frame


A, B = (60, 80), (140, 80)
SPACE = space_of("translation", np.stack([square(*A), square(*B)]), degree=1)
BOTH = picture(A, B)


def likelihood(exclusion="wires", **options):
    return contours(
        SPACE, 2, exclusion=exclusion, clutter=0.5, detector=DETECTOR, num_lines=32, **options
    )


WIRES, OPAQUE = likelihood(), likelihood("opaque")


@jax.jit
def alone(likelihood, frame, substates):
    """``[P, K]`` of substates ``[P, K, D]``."""
    observation, (targets, count, dimension) = likelihood.observe(frame), substates.shape
    flat = substates.reshape(-1, dimension).T
    partition = jnp.repeat(jnp.arange(targets), count)
    return likelihood.log_prob_all(observation, partition, flat).reshape(targets, count)


@jax.jit
def together(likelihood, frame, substates):
    """``[K]`` of substates ``[P, K, D]``."""
    substates = jnp.moveaxis(substates, 1, 2)
    return likelihood.log_joint_all(likelihood.observe(frame), substates, None)


@jax.jit
def with_label(likelihood, frame, substates, label):
    observation, substates = likelihood.observe(frame), jnp.moveaxis(substates, 1, 2)
    return likelihood.log_joint_labelled_all(observation, substates, None, label)


@jax.jit
def log_odds(likelihood, frame, partition, substates):
    return likelihood.log_odds_all(likelihood.observe(frame), partition, substates)


@pytest.mark.parametrize(
    "made",
    [WIRES, *(pytest.param(x, marks=pytest.mark.slow) for x in (OPAQUE, likelihood("none")))],
)
def test_log_odds_say_whether_a_contour_is_on_its_target(made):
    places = jnp.array([[0.0, 0.0], [25.0, 25.0], [np.nan, 0.0]]).T
    targets = jnp.zeros(3, int)
    on, beside, nowhere = log_odds(made, BOTH, targets, places)
    assert on > 3
    assert beside < -1
    assert np.isnan(nowhere)
    assert log_odds(made, picture(), targets, places)[0] < -3


@jax.jit
def find(detector, frame, x, y, normal_x, normal_y):
    """The features on one line."""
    lines = Lines(*(jnp.array([v]) for v in (x, y, normal_x, normal_y)))
    return detector.find(detector.observe(frame), lines)


def shifts(*pairs):
    """``[P, 8, 2]``: up to 8 pairs of shifts, the last one repeated: one shape, one program."""
    pairs = [*pairs, *[pairs[-1]] * (8 - len(pairs))]
    return np.array(pairs, np.float32).swapaxes(0, 1)


REST, AWAY = (0.0, 0.0), (80.0, 0.0)


@pytest.mark.slow
def test_lines_may_count_for_less_than_independent_ones():
    moved = shifts((REST, REST), (AWAY, REST), ((4.0, 3.0), (-5.0, 1.0)))
    less = dataclasses.replace(WIRES, independence=0.25)
    whole, share = alone(WIRES, BOTH, moved), alone(less, BOTH, moved)
    constant = np.asarray(share) - 0.25 * np.asarray(whole)
    np.testing.assert_allclose(constant, constant[0, 0], atol=1e-3)
    assert constant[0, 0] > 32 * 0.1  # what makes a density of a share of each line
    away = shifts(((-2.0, 1.0), (2.0, 0.0)))
    np.testing.assert_allclose(
        together(less, BOTH, away), np.asarray(alone(less, BOTH, away)).sum(axis=0), rtol=1e-4
    )


def test_a_line_finds_the_edges_it_crosses():
    found = find(FAR_SIGHTED, BOTH, 60.0, 50.0, 0.0, 1.0)
    assert np.asarray(found.present).sum() == 1
    assert float(found.places[0, 0]) == pytest.approx(0, abs=1)
    beside = find(FAR_SIGHTED, BOTH, 100.0, 80.0, 1.0, 0.0)
    np.testing.assert_allclose(np.sort(np.asarray(beside.places)[:2, 0]), (-10, 10), atol=1)


def test_only_the_strongest_features_are_kept():
    frame = picture(A)
    frame[:, 150:] = 100  # a weaker edge, right of the square's
    few = dataclasses.replace(FAR_SIGHTED, max_features=1)
    kept, every = (find(detector, frame, 110.0, 80.0, 1.0, 0.0) for detector in (few, FAR_SIGHTED))
    assert np.asarray(every.present).sum() == 2
    np.testing.assert_array_equal(kept.places[0], every.places[0])
    assert float(kept.places[0, 0]) == pytest.approx(-20, abs=1)


def test_a_contour_is_likeliest_on_its_edges():
    steps = [(d, 0.0) for d in np.arange(-15.0, 16.0, 5.0)]
    values = np.asarray(alone(WIRES, BOTH, shifts(*[(s, s) for s in steps])))
    assert (values.argmax(axis=1) == 3).all()
    assert (values[:, 3] - values[:, [0, -1]].max(axis=1) > 5).all()


def test_targets_that_are_apart_are_independent():
    # Sides 20 pixels apart lie just within reach of each other's lines; these are farther apart.
    substates = shifts(((-2.0, 1.0), (2.0, 0.0)), ((-8.0, 3.0), (9.0, 0.0)))
    apart = np.asarray(alone(WIRES, BOTH, substates)).sum(axis=0)
    np.testing.assert_allclose(together(WIRES, BOTH, substates), apart, rtol=1e-4)


def test_exclusion_forbids_two_targets_on_one_and_the_product_does_not():
    hypotheses = shifts((REST, REST), (AWAY, REST), (REST, (-80.0, 0.0)))
    exclusive = np.asarray(together(WIRES, BOTH, hypotheses))
    assert exclusive[0] - exclusive[1:].max() > 30
    product = np.asarray(alone(WIRES, BOTH, hypotheses)).sum(axis=0)
    np.testing.assert_allclose(product, product[0], atol=8)


def test_a_hidden_boundary_is_not_missed_where_the_label_says_so():
    """B stands behind A: what A covers of it shows no edge."""
    frame = picture((110, 80))  # the nearer one, drawn over a larger one
    frame = np.minimum(frame, picture((140, 80), grey=120))
    position = shifts(((50.0, 0.0), REST))
    front, behind = (float(with_label(OPAQUE, frame, position, np.full(8, y))[0]) for y in (0, 1))
    assert front - behind > 10
    wires = float(together(WIRES, frame, position)[0])
    assert front > wires


HOLDING = space_of("similarity", np.stack([square(*A), square(*B)]), degree=1)


def test_one_edge_pays_once():
    """A contour drawn inside an opaque target in front earns nothing from that target's edge."""
    inside = np.stack([square(*A), square(*A, half=18.0)])
    truth = np.stack([square(*A), square(*B)])
    places = [np.asarray(HOLDING.project(one)) for one in (truth, inside)]
    substates = np.stack([*places, *[places[1]] * 6], axis=1).astype(np.float32)
    front = np.zeros(8, int)
    found = {}
    for exclusion in ("opaque", "opaque-literal"):
        made = contours(HOLDING, 2, exclusion=exclusion, clutter=0.5, detector=DETECTOR)
        found[exclusion] = np.asarray(with_label(made, BOTH, substates, front))[:2]
        first = float(np.asarray(alone(made, BOTH, substates))[0, 1])
    assert found["opaque"][1] == pytest.approx(first, rel=1e-5)
    assert found["opaque"][0] - first > 40
    # Eq. 5 as printed, the front's edge paid twice: no worse than the truth.
    assert found["opaque-literal"][1] > found["opaque-literal"][0]


@pytest.mark.slow
def test_a_contour_folded_back_on_half_a_worm_is_paid_once():
    """The literal rule scores the hairpin like the truth; paid once, it gets what one leg earns."""
    frame = np.full((HEIGHT, WIDTH, 3), 200, np.uint8)
    frame[77:83, 20:180] = 60
    along = np.linspace(20, 180, 12)
    truth = np.stack([along, np.full(12, 80.0)], axis=1)
    folded = np.concatenate([np.linspace(24, 100, 6), np.linspace(96, 28, 6)])
    hairpin = np.stack([folded, np.where(np.arange(12) < 6, 79.5, 80.5)], axis=1)
    half = np.stack([np.linspace(24, 100, 12), np.full(12, 80.0)], axis=1)
    space = space_of("translation", np.stack([truth, hairpin, half]), closed=False)
    scores = {}
    for exclusion in ("none", "none-literal", "wires"):
        made = contours(
            space, 3, exclusion=exclusion, clutter=0.5, detector=DETECTOR, width=6.0, sigma=3.0
        )
        rest = np.zeros((3, 8, 2), np.float32)
        scores[exclusion] = np.asarray(alone(made, frame, rest))[:, 0]
    for exclusion in ("none", "wires"):  # what one target alone earns is the same in both
        whole, hairpin, one_leg = scores[exclusion]
        assert hairpin < 0.6 * whole
        assert hairpin < one_leg
    whole, hairpin, _ = scores["none-literal"]
    assert hairpin > 0.95 * whole
    np.testing.assert_allclose(scores["none"][[0, 2]], scores["none-literal"][[0, 2]], rtol=1e-5)


@pytest.mark.parametrize("apart", [12, pytest.param(30, marks=pytest.mark.slow)])
def test_both_sides_of_a_narrow_body_are_paid(apart):
    """Lines see across it: what lies there is another edge, and explains its own feature."""
    frame = np.full((HEIGHT, WIDTH, 3), 200, np.uint8)
    frame[80 - apart // 2 : 80 + apart // 2, 40:160] = 60
    step = np.linspace(40, 160, 9)[:-1]
    top = np.stack([step, np.full(8, 80.0 - apart / 2)], axis=1)
    outline = np.concatenate([top, np.array([200.0, 160.0]) - top])
    space = space_of("translation", outline[None], degree=1)
    rest = np.zeros((1, 8, 2), np.float32)

    def value(exclusion):
        made = contours(space, 1, exclusion=exclusion, clutter=0.5, detector=DETECTOR, sigma=3.0)
        return float(alone(made, frame, rest)[0, 0])

    assert value("none") > 0.9 * value("none-literal")


def test_eight_wires_are_a_program_of_bounded_size():
    """Sums over sets of boundaries and orders that are written out take minutes to compile."""
    eight = space_of("translation", np.stack([square(*A)] * 8), degree=1)
    substates = jnp.zeros((8, 2, 4))
    for exclusion in ("wires-literal", "wires"):
        made = contours(eight, 8, exclusion=exclusion, clutter=0.5, detector=DETECTOR)
        observation = jax.eval_shape(made.observe, BOTH)
        program = jax.make_jaxpr(made.log_joint_all)(observation, substates, None)
        assert str(program).count(" = ") < 3500


@pytest.mark.parametrize("shift", [18.0, 10.0, 3.0])
def test_labels_are_equal_while_shapes_are_beside_each_other(shift):
    """Each lies on the other's lines, and nothing is hidden: who is in front says nothing."""
    beside = shifts(((shift / 2, 0.0), (-shift / 2, 0.0)), ((4.0, 1.0), (-7.0, 2.0)))
    first, second = (with_label(OPAQUE, BOTH, beside, np.full(8, y)) for y in (0, 1))
    np.testing.assert_array_equal(first, second)
    assert not np.array_equal(first, np.asarray(alone(OPAQUE, BOTH, beside)).sum(axis=0))
    literal = likelihood("opaque-literal")
    np.testing.assert_array_equal(
        *(with_label(literal, BOTH, beside, np.full(8, y)) for y in (0, 1))
    )


def test_without_labels_both_count_alike():
    over = shifts(((50.0, 0.0), (0.0, 4.0)), ((20.0, 1.0), (-30.0, 2.0)))
    each = np.stack([with_label(OPAQUE, BOTH, over, np.full(8, y)) for y in (0, 1)])
    np.testing.assert_allclose(
        together(OPAQUE, BOTH, over), np.logaddexp(*each) - np.log(2), rtol=1e-5
    )
    assert not np.allclose(each[0], each[1])


def test_a_hidden_crossing_takes_no_place_from_a_visible_one():
    """The line's nearest crossing of the farther outline is hidden, the next one is not."""
    places = np.array([-3.0, 9.0, 15.0, 0.0]).reshape(4, 1, 1, 1) * np.ones((1, 1, 2, 1))
    there = np.array([True, True, True, False]).reshape(4, 1, 1, 1) & np.ones((1, 1, 2, 1), bool)
    kept, seen = map(np.asarray, first(places, there & (places != -3.0), 2))
    assert kept[:, 0, 0, 0].tolist() == [9.0, 15.0]
    assert seen.all()
    kept, seen = map(np.asarray, first(places, there & (places > 10.0), 2))
    assert (kept[:, 0, 0, 0].tolist(), seen[:, 0, 0, 0].tolist()) == ([15.0, 0.0], [True, False])


def test_only_what_is_seen_counts():
    """A contour half outside is judged by the half inside, one outside by nothing."""
    values = np.asarray(alone(WIRES, BOTH, shifts(((-400.0, 0.0), (-60.0, 0.0)))))
    assert values[0, 0] == 0.0
    assert np.isfinite(values).all()


def test_a_substate_that_is_not_finite_is_no_likelihood_and_harms_no_other():
    substates = shifts(
        ((np.nan, 0.0), REST), ((np.inf, 0.0), REST), ((1e30, 0.0), REST), (REST, REST)
    )
    values = np.asarray(alone(WIRES, BOTH, substates))
    assert np.isnan(values[0, :2]).all()
    assert np.isfinite(values[0, 2:]).all()
    assert np.isfinite(values[1]).all()
    joint = np.asarray(together(WIRES, BOTH, substates))
    assert np.isnan(joint[:2]).all()
    assert np.isfinite(joint[2:]).all()


@pytest.mark.slow
@pytest.mark.always
def test_a_wire_has_two_edges():
    frame = np.full((HEIGHT, WIDTH, 3), 200, np.uint8)
    frame[72:88] = 60
    middle = np.stack([np.linspace(40, 160, 8), np.full(8, 80.0)], axis=1)
    space = space_of("translation", middle[None], closed=False)
    wire = contours(
        space, 1, exclusion="none", clutter=0.5, detector=DETECTOR, width=16.0, sigma=3.0
    )
    values = np.asarray(alone(wire, frame, shifts((REST,), ((0.0, 8.0),), ((0.0, -8.0),))))[0]
    assert values[0] - values[1:].max() > 20
    one_edge = contours(space, 1, exclusion="none", clutter=0.5, detector=DETECTOR, sigma=3.0)
    values = np.asarray(alone(one_edge, frame, shifts((REST,), ((0.0, 8.0),))))[0]
    assert values[1] > values[0]


def test_crossings_are_found_where_they_are_nearest_first():
    lines = Lines(*(np.array([[v]]) for v in (50.0, 50.0, 1.0, 0.0)))
    x, y = np.array([40.0, 40, 55, 55, 90]), np.array([40.0, 60, 60, 40, 40])
    polyline = Polyline(x[:, None], y[:, None], np.arange(5) > 0)
    nearest = jax.jit(nearest_crossings, static_argnums=3)
    places, there = map(np.asarray, nearest(lines, polyline, 20.0, 3))
    np.testing.assert_allclose(places[:2, 0, 0], (5, -10))
    np.testing.assert_array_equal(there[:, 0, 0], (True, True, False))
    _, near = nearest(lines, polyline, 8.0, 3)
    np.testing.assert_array_equal(np.asarray(near)[:, 0, 0], (True, False, False))


def test_inside_is_told_from_outside_of_a_concave_outline():
    outline = np.array([(0, 0), (10, 0), (10, 10), (5, 3), (0, 10), (0, 0)], float)
    polyline = Polyline(outline[:, :1], outline[:, 1:], np.arange(6) > 0)
    x, y = np.array([(1.0, 5.0), (9.0, 5.0), (5.0, 5.0), (5.0, 1.0), (-1.0, 5.0)]).T
    inside = jax.jit(is_inside)(x, y, polyline)
    assert inside.tolist() == [True, True, False, True, False]


def test_clutter_is_learned_and_what_was_not_seen_is_smoothed():
    rng = np.random.default_rng(0)
    noise = np.repeat(rng.integers(0, 255, (2, HEIGHT, WIDTH, 1), dtype=np.uint8), 3, axis=-1)
    busy = np.asarray(learn_clutter(noise, DETECTOR))
    assert busy.sum() == pytest.approx(1, abs=1e-5)
    calm = np.asarray(learn_clutter(BOTH[None], DETECTOR))
    assert (calm > 0).all()
    assert calm @ np.arange(7) < busy @ np.arange(7)
    assert poisson_clutter(0.5, 3).shape == (4,)
