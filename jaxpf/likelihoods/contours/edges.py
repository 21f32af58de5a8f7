"""Edges on measurement lines: gradient images once per frame, features line by line.

The gradient of the frame's brightness is computed once per frame and shared by all runs and
particles.  A line reads it at the nearest pixels, at steps of one pixel; its response is the
absolute gradient along the line.  A feature is a local maximum of the response above a threshold,
located to the nearest sample.  This is fine enough if sigma is several pixels.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from jaxpf.contract.errors import InputError
from jaxpf.contract.numbers import check_number, check_whole
from jaxpf.contract.pytree import pytree_dataclass, static_field
from jaxpf.likelihoods.color import check_frame

#: Steps of the stored gradient per grey level and pixel; 16 bits hold up to 511.
_STEPS = 64.0
#: Brightness of red, green and blue (ITU-R BT.601).
_BRIGHTNESS = (0.299, 0.587, 0.114)
#: A feature is packed into one integer: its response and, in the lowest bits, its place.
_PLACE_BITS = 8
_LONGEST_LINE = 2**_PLACE_BITS - 3


class Lines(NamedTuple):
    """Measurement lines, ``[M, N]`` each or of any other common shape.

    Attributes:
        x: of the middle, in pixels; pixel (0, 0) is the square [0, 1) x [0, 1).
        y: of the middle.
        along_x: x component of the line's unit direction.
        along_y: its y component.
    """

    x: jax.Array
    y: jax.Array
    along_x: jax.Array
    along_y: jax.Array


class Features(NamedTuple):
    """Features found on lines, strongest first, at most F per line.

    Attributes:
        places: ``[F, ...]``, pixels along the line from its middle.
        present: ``[F, ...]`` bool.
    """

    places: jax.Array
    present: jax.Array


@pytree_dataclass
class EdgeDetector:
    """A one-dimensional edge detector.

    Attributes:
        threshold: least response of a feature, grey levels (0 to 255) per pixel.
        length: static, L, length in pixels of a line on which features may lie; odd.
        max_features: static, maximum number of features kept per line, the strongest.
        smoothing: static, standard deviation of the blur before the gradient, pixels.
    """

    threshold: float | jax.Array = 8.0
    length: int = static_field(default=41)
    max_features: int = static_field(default=6)
    smoothing: float = static_field(default=1.0)

    def __post_init__(self):
        check_whole("length", self.length, 3, _LONGEST_LINE)
        check_number("smoothing", self.smoothing, least=0, most=20)
        check_number("threshold", self.threshold, least=0)
        if self.length % 2 == 0:
            raise InputError(f"length={self.length} of the lines must be an odd number of pixels.")
        # Two features are at least two pixels apart.
        check_whole("max_features", self.max_features, most=self.length // 2 + 1)

    @property
    def reach(self) -> float:
        """Half of L: features lie between -reach and reach."""
        return self.length / 2

    def observe(self, frame) -> jax.Array:
        """The frame's gradient, one int32 word per pixel, with a margin of zeros.

        Args:
            frame: uint8 RGB ``[H, W, 3]``.
        """
        check_frame(frame)
        gradient = brightness_gradient(frame, self.smoothing)
        limit = 2**15 - 1
        steps = jnp.clip(jnp.round(gradient * _STEPS), -limit, limit).astype(jnp.int32)
        words = (steps[0] & 0xFFFF) | (steps[1] << 16)
        return jnp.pad(words, self._margin)

    def frame_size(self, observation) -> tuple[int, int]:
        """Width and height of the observed frame."""
        height, width = observation.shape
        return width - 2 * self._margin, height - 2 * self._margin

    def find(self, observation, lines: Lines) -> Features:
        """The features on lines; there are none outside the frame.

        One scan along all lines at once, which holds only the last three responses and the features
        found so far.
        """
        width, height = self.frame_size(observation)
        stride, words = observation.shape[1], observation.reshape(-1)
        beyond = self.length // 2 + 2  # lines this far outside do not reach the frame
        x = jnp.clip(lines.x, -beyond, width + beyond) + self._margin
        y = jnp.clip(lines.y, -beyond, height + beyond) + self._margin

        def response(step):
            column = (x + step * lines.along_x).astype(jnp.int32)
            row = (y + step * lines.along_y).astype(jnp.int32)
            word = words.at[row * stride + column]
            word = word.get(mode="promise_in_bounds", wrap_negative_indices=False)
            across, down = ((word << 16) >> 16).astype(x.dtype), (word >> 16).astype(x.dtype)
            return jnp.abs(across * lines.along_x + down * lines.along_y)

        half = self.length // 2
        threshold = jnp.asarray(self.threshold, x.dtype) * _STEPS
        largest = jnp.iinfo(jnp.int32).max

        def along(carry, step):
            strongest, before, here = carry
            after = response(step)
            is_feature = (here > threshold) & (here >= before) & (here > after)
            place = (step - 1 + half).astype(jnp.int32)
            new = jnp.where(is_feature, (here.astype(jnp.int32) << _PLACE_BITS) + place, 0)
            # Insertion into a sorted list: each entry, the one above it, or the new one.
            above = jnp.concatenate([jnp.full_like(strongest[:1], largest), strongest[:-1]])
            return (jnp.maximum(strongest, jnp.minimum(above, new)), here, after), None

        steps = jnp.arange(-half - 1, half + 2, dtype=x.dtype)
        none = jnp.zeros((self.max_features, *x.shape), jnp.int32)
        begin = none, response(steps[0]), response(steps[1])
        (strongest, _, _), _ = lax.scan(along, begin, steps[2:])
        places = (strongest & (2**_PLACE_BITS - 1)).astype(x.dtype) - half
        return Features(places, strongest > 0)

    @property
    def _margin(self) -> int:
        return self.length + 6


def brightness_gradient(frame, smoothing: float) -> jax.Array:
    """Gradient ``[2, H, W]`` in x and y of a frame's blurred brightness, grey levels per pixel."""
    grey = sum(
        (share * frame[..., k].astype(jnp.float32) for k, share in enumerate(_BRIGHTNESS)),
        start=jnp.zeros(frame.shape[:2], jnp.float32),
    )
    radius = int(np.ceil(3 * smoothing))
    offsets = np.arange(-radius, radius + 1)
    blur = np.exp(-0.5 * (offsets / max(smoothing, 1e-6)) ** 2)
    blur, half = blur / blur.sum(), np.array([-0.5, 0.0, 0.5])
    for axis in (0, 1):
        grey = _filtered(grey, blur, axis)
    return jnp.stack([_filtered(grey, half, 1), _filtered(grey, half, 0)])


def _filtered(image, kernel: np.ndarray, axis: int):
    """Correlation with a short kernel along an axis; border pixels are repeated."""
    radius = len(kernel) // 2
    pad = [(0, 0), (0, 0)]
    pad[axis] = (radius, radius)
    padded = jnp.pad(image, pad, mode="edge")
    length = image.shape[axis]
    parts = [
        float(weight) * lax.slice_in_dim(padded, k, k + length, axis=axis)
        for k, weight in enumerate(kernel)
    ]
    return sum(parts[1:], start=parts[0])
