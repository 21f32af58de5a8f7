"""Options of the contour model."""

import dataclasses

from jaxpf.contract.errors import Argument, InputError
from jaxpf.contract.names import EXCLUSIONS, SHAPE_SPACES
from jaxpf.contract.options import check_options, option, plain
from jaxpf.contract.ranges import RANGES
from jaxpf.targets.appearance import slip_option

#: The depth order of separate contours is unknown; few particles would keep an arbitrary one.
FLIP = 0.5


@dataclasses.dataclass(frozen=True)
class Options:
    """Options of the contour model; see the help of each."""

    shape_space: str | None = option(
        None,
        "How shapes may change: translation, similarity (default; also turns and scales) or "
        "affine.  Other shapes are learned, see --learned.",
        kind=str,
        choices=SHAPE_SPACES,
        common=True,
        compiles=True,
    )
    noise_shift: float | None = option(
        None,
        "Noise of the shift in x and y per frame, in pixels; by default 0.05 of the contour's "
        "size, or learned (contours only).  The size is the side of a square with the diagonal of "
        "the bounding box of the control points.",
        kind=float,
        least=0,
    )
    noise_bend: float | None = option(
        None,
        "Noise of every other coordinate of the shape per frame, in pixels by which points of the "
        "contour move; by default 0.006 of the contour's size, or learned (contours only).",
        kind=float,
        least=0,
    )
    exclusion: str = option(
        "wires",
        "Whether an edge may belong to several contours: wires (to one only), opaque or none.  "
        "opaque is for two to four closed contours, of which nearer ones hide others; with none, "
        "look-alikes coalesce.  In wires-literal, opaque-literal and none-literal, as published, "
        "every line near an edge counts it.",
        choices=EXCLUSIONS,
        common=True,
        compiles=True,
    )
    wire_width: float | None = option(
        None,
        "Width in pixels of a wire with two visible edges; by default that of the file (open "
        "contours only).",
        kind=float,
        **RANGES["width"],
    )
    lines: int = option(
        32,
        "Number of measurement lines on a contour (contours only).",
        **RANGES["num_lines"],
        compiles=True,
    )
    line_length: int = option(
        41,
        "Length of a measurement line, an odd number of pixels: edges are found up to half of it "
        "away (contours only).",
        **RANGES["length"],
        compiles=True,
    )
    edge_threshold: float = option(
        8.0,
        "Weakest edge that counts, in grey levels per pixel (contours only).",
        **RANGES["threshold"],
    )
    edge_smoothing: float = option(
        1.0,
        "Blur of the frame before edges are found, in pixels (contours only).",
        **RANGES["smoothing"],
        compiles=True,
    )
    sigma: float = option(
        7.0,
        "Standard deviation of an edge's distance from the contour, in pixels (contours only).",
        **RANGES["sigma"],
    )
    independence: float = option(
        0.3,
        "Weight of a measurement line's log likelihood: less than 1, since neighbouring lines see "
        "the same edge (contours only).  1 as published, where few particles keep any weight.",
        **RANGES["independence"],
    )
    clutter: float | None = option(
        None,
        "Mean number of edges on a measurement line of the background; by default the distribution "
        "of that number is learned from the start frame (contours only).",
        kind=float,
        **RANGES["clutter"],
    )
    slip: float | None = slip_option()
    flip: float | None = option(
        None,
        "Probability per frame that two contours next to each other in depth change places, unless "
        f"they overlap; by default {FLIP:g}, which forgets the order while they are apart (opaque "
        "contours only).  0.01 as published.",
        kind=float,
        **RANGES["flip"],
    )

    def __post_init__(self) -> None:
        check_options(self)
        if self.flip is not None and not self.hides:
            raise InputError(
                Argument("flip", plain(self.flip)),
                " works only with contours that hide one another, but exclusion is "
                f"{self.exclusion!r}; choose exclusion 'opaque', or leave it out.",
            )
        if self.noise_bend is not None and self.shape_space == "translation":
            raise InputError(
                Argument("noise_bend", plain(self.noise_bend)),
                " works only with shapes that change, but 'translation' only shifts them; leave "
                "one of them out.",
            )

    @property
    def hides(self) -> bool:
        """Whether contours occlude one another."""
        return self.exclusion.startswith("opaque")
