"""Appearance of points by the features of a pretrained network.

A network turns a whole frame into maps, and a point is where they look as they did at the point in
the start frame.  With f(x) a map's features at x, each channel less its mean in the start frame and
over its spread there, and f_0 those at the point's start::

    y(x) = mean over maps of  f(x) . f_0 / (|f(x)| |f_0|)
    log p(y | x) = sharpness * y(x)

Between places of the maps, y is interpolated linearly; outside the frame it is 0.  All windows of a
frame are compared at once, so the cost of a frame depends on its size and hardly on the number of
particles.

``log_odds_all`` says whether points are where they are reported.  With e the 95% quantile of y in
the start frame::

    log odds = -2.5 + 9.6 (y - e)

This is a logistic regression on two clips, see "A network's features" in
docs/development/defaults.md.
"""

from collections.abc import Callable, Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from jaxpf.contract import Likelihood
from jaxpf.contract.errors import InputError
from jaxpf.contract.numbers import check_number
from jaxpf.contract.pytree import as_array, pytree_dataclass, static_field
from jaxpf.likelihoods._checks import points_in
from jaxpf.likelihoods._integral import line_before
from jaxpf.likelihoods.color import check_frame
from jaxpf.likelihoods.discriminative.likelihood import check_size
from jaxpf.likelihoods.discriminative.pictures import shrunk, size_of
from jaxpf.likelihoods.pretrained.build import LEAST_SPREAD, as_network
from jaxpf.likelihoods.pretrained.likelihood import maps_of
from jaxpf.likelihoods.pretrained.network import efficientnet_lite0
from jaxpf.lowering.columns import entries_at
from jaxpf.lowering.programs import compiled

#: Of the log odds: constant, and factor of the score above e.
_ODDS = -2.5, 9.6
#: Share of the places that match worse than e.
_WORSE = 0.95
#: The network sees frames whose sides are multiples of it, shrunk to at most so many pixels.
_MULTIPLE, _LONGEST = 32, 1000


@pytree_dataclass
class PretrainedPoints(Likelihood):
    """Appearance of P points by a network's features; make one with :func:`pretrained_points`.

    A substate is (u, v, ...): pixels from the left and the top of the frame.

    Attributes:
        sharpness: scalar; larger trusts the score more.
        references: for each map, unit vectors [P, C].
        middles: for each map, [C], subtracted from it.
        spreads: for each map, [C], by which it is divided then.
        network: function of a frame, float [h, w, 3] from 0 to 1, that returns maps [h / s, w / s,
            C]; a pytree.
        elsewhere: [P], e of the log odds.
        slip: standard deviation in pixels of a point around its best match, because surfaces turn
            and skin slides; the ``model_error`` of x and y.
        frame_shape: height and width of all frames.
    """

    sharpness: ArrayLike
    references: tuple[jax.Array, ...]
    middles: tuple[jax.Array, ...]
    spreads: tuple[jax.Array, ...]
    network: Callable
    elsewhere: jax.Array
    slip: ArrayLike
    frame_shape: tuple[int, int] = static_field()

    #: ``observe`` depends on the start frame, not on parameters that tuning may change.
    fixed_observation = True
    form = "exponential"

    @property
    def model_error(self):
        """Standard deviations of the truth around the best match: the slip in x and y."""
        return self.slip, self.slip, 0.0

    def observe(self, frame):
        """Scores of all points in all places, float32 [P, h / s, w / s], s of the finest map.

        Args:
            frame: uint8 RGB [H, W, 3].
        """
        check_size(frame, self.frame_shape)
        maps = _maps(self.network, jnp.asarray(frame))
        return _scores(maps, self.middles, self.spreads, self.references)

    def log_prob_all(self, observation, partition, substates):
        """Log-likelihoods [N] of substates [D, N]; NaN if u or v is not finite."""
        score, finite = self._score(observation, partition, substates)
        log_prob = jnp.asarray(self.sharpness, score.dtype) * score
        return jnp.where(finite, log_prob, jnp.nan)

    def log_odds_all(self, observation, partition, substates):
        """Log odds [N] that points are where they are reported; NaN as for ``log_prob_all``."""
        score, finite = self._score(observation, partition, substates)
        constant, slope = _ODDS
        above = score - jnp.asarray(self.elsewhere, score.dtype)[partition]
        return jnp.where(finite, constant + slope * above, jnp.nan)

    def _score(self, scores, partition, substates):
        """Scores [N], and whether u and v are finite."""
        dtype = substates.dtype
        finite = jnp.all(jnp.isfinite(substates[:2]), axis=0)
        u, v = jnp.where(finite, substates[:2], 0)
        height, width = self.frame_shape
        inside = (u >= 0) & (u < width) & (v >= 0) & (v < height)
        index, shares = _places(u, v, scores.shape[1:], self.frame_shape)
        around = entries_at(scores.reshape(-1), partition * scores[0].size + index)
        return jnp.where(inside, jnp.sum(around.astype(dtype) * shares, axis=0), 0), finite


def pretrained_points(
    frame: np.ndarray,
    points: ArrayLike,
    *,
    network: Callable | None = None,
    sharpness: float = 40.0,
    slip: float = 0.0,
) -> PretrainedPoints:
    """Learn P points' appearance by a network's features from one frame.

    Args:
        frame: uint8 RGB [H, W, 3].
        points: [P, 2], x and y in pixels, inside the frame.
        network: your own, see :func:`jaxpf.likelihoods.pretrained`; here it gets the whole frame,
            shrunk by a whole factor to at most 1000 pixels and filled up to multiples of 32.
        sharpness: trust in the scores.
        slip: standard deviation in pixels of a point around its best match.
    """
    check_frame(frame)
    frame = np.asarray(frame)
    points = points_in(points, frame.shape[:2])
    check_number("sharpness", sharpness, above=0)
    check_number("slip", slip, least=0)
    network = as_network(efficientnet_lite0() if network is None else network)
    shape = int(frame.shape[0]), int(frame.shape[1])
    maps = compiled(_maps)(network, jnp.asarray(frame))
    middles = tuple(jnp.mean(each, axis=(0, 1)) for each in maps)
    spreads = tuple(jnp.std(each, axis=(0, 1)) + LEAST_SPREAD for each in maps)
    if not all(np.isfinite(each).all() for each in (*middles, *spreads)):
        raise InputError("the network makes NaN or infinite maps of the start frame.")
    u, v = as_array(points, float).T
    references = []
    for each, middle, spread in zip(maps, middles, spreads, strict=True):
        height, width, channels = each.shape
        features = ((each - middle) / spread).reshape(-1, channels)
        index, shares = _places(u, v, (height, width), shape)
        references.append(_unit(jnp.einsum("kpc,kp->pc", features[index], shares)))
    scores = np.asarray(_scores(maps, middles, spreads, references)).reshape(len(points), -1)
    return PretrainedPoints(
        sharpness=as_array(sharpness, float),
        references=tuple(references),
        middles=middles,
        spreads=spreads,
        network=network,
        elsewhere=as_array(np.quantile(scores, _WORSE, axis=1), float),
        slip=as_array(slip, float),
        frame_shape=shape,
    )


def _network_size(frame_shape: tuple[int, int]) -> tuple[int, int, int]:
    """By how much a frame is shrunk for the network; height and width of what the network sees."""
    factor = -(-max(frame_shape) // _LONGEST)
    rows, columns = (-(-side // _MULTIPLE) * _MULTIPLE for side in size_of(frame_shape, factor))
    return factor, rows, columns


def _maps(network: Callable, frame: jax.Array) -> tuple[jax.Array, ...]:
    """The network's maps of a frame, which is filled up by its last row and column."""
    factor, rows, columns = _network_size((frame.shape[0], frame.shape[1]))
    seen = shrunk(frame, factor) / 255
    padding = ((0, rows - seen.shape[0]), (0, columns - seen.shape[1]), (0, 0))
    return maps_of(network, jnp.pad(seen, padding, mode="edge"))


def _scores(
    maps: Sequence[jax.Array],
    middles: Sequence[jax.Array],
    spreads: Sequence[jax.Array],
    references: Sequence[jax.Array],
) -> jax.Array:
    """Scores of all points in all places of the finest map, [P, h, w]; see the class."""
    height, width = max(each.shape[:2] for each in maps)
    total = jnp.zeros((), maps[0].dtype)
    for each, middle, spread, own in zip(maps, middles, spreads, references, strict=True):
        features = _unit((each - middle) / spread)
        cosines = jnp.einsum("hwc,pc->phw", features, own, precision="highest")
        total += jax.image.resize(cosines, (len(own), height, width), "linear")
    return total / len(maps)


def _unit(vectors: jax.Array) -> jax.Array:
    """Vectors [..., C] of length 1; one of zeros stays so."""
    return vectors * jax.lax.rsqrt(jnp.maximum(jnp.sum(vectors**2, -1, keepdims=True), 1e-12))


def _places(u, v, size, frame_shape):
    """Indices and shares [4, N] of the places of a map [h, w] around points of the frame."""
    (height, width), (factor, rows, columns) = size, _network_size(frame_shape)
    row, below = line_before(v * (height / (rows * factor)) - 0.5, height - 1)
    column, beyond = line_before(u * (width / (columns * factor)) - 0.5, width - 1)
    right, down = jnp.minimum(column + 1, width - 1), jnp.minimum(row + 1, height - 1)
    index = jnp.stack([line * width + at for line in (row, down) for at in (column, right)])
    shares = jnp.stack([y * x for y in (1 - below, below) for x in (1 - beyond, beyond)])
    return index, shares
