"""Settings of the descent: steps, runs and the stopping rule."""

import dataclasses
from typing import Annotated

from jaxpf.contract.options import Option, check_fields


@dataclasses.dataclass(frozen=True)
class Settings:
    """Settings of the descent and options of ``jaxpf tune``."""

    steps: Annotated[int, Option("Maximum number of steps per repeat.", least=1)] = 150
    repeats: Annotated[
        int,
        Option(
            "Number of independent descents.  Their spread shows how far values depend on chance.",
            least=1,
        ),
    ] = 3
    learning_rate: Annotated[
        float,
        Option(
            "Adam's step size on the unconstrained numbers.  0.1 changes a positive parameter by "
            "up to 10% per step.",
            above=0,
        ),
    ] = 0.1
    runs: Annotated[int, Option("Tracker runs per sequence and step.", least=1)] = 4
    sequences_per_step: Annotated[
        int | None, Option("Sequences per step, in rotation.", least=1)
    ] = None
    clip: Annotated[
        float,
        Option("Maximum norm of the gradient; longer gradients are shortened to it.", above=0),
    ] = 10.0
    window: Annotated[
        int,
        Option("Number of steps in a window.  Tuned values are means over the last one.", least=1),
    ] = 20
    tolerance: Annotated[
        float,
        Option(
            "Stop when the mean of every unconstrained number over a window differs by at most "
            "this from the window before.  0.02 is 2% of a positive parameter.",
            least=0,
        ),
    ] = 0.02
    jitter: Annotated[
        float,
        Option(
            "Standard deviation of the noise on the initial unconstrained numbers of every repeat "
            "but the first.",
            least=0,
        ),
    ] = 0.3
    seed: Annotated[int, Option("Random seed.", least=0, most=2**32 - 1)] = 0

    def __post_init__(self) -> None:
        check_fields(self)
