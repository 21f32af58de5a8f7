"""Settings of the descent: steps, runs and the stopping rule."""

import dataclasses

from jaxpf.contract.options import check_options, option


@dataclasses.dataclass(frozen=True)
class Settings:
    """Settings of the descent and options of ``jaxpf tune``."""

    steps: int = option(150, "Maximum number of steps per repeat.", least=1)
    repeats: int = option(
        3,
        "Number of independent descents.  Their spread shows how far values depend on chance.",
        least=1,
    )
    learning_rate: float = option(
        0.1,
        "Adam's step size on the unconstrained numbers.  0.1 changes a positive parameter by up to "
        "10% per step.",
        above=0,
    )
    runs: int = option(4, "Tracker runs per sequence and step.", least=1)
    sequences_per_step: int | None = option(None, "Sequences per step, in rotation.", least=1)
    clip: float = option(
        10.0, "Maximum norm of the gradient; longer gradients are shortened to it.", above=0
    )
    window: int = option(
        20, "Number of steps in a window.  Tuned values are means over the last one.", least=1
    )
    tolerance: float = option(
        0.02,
        "Stop when the mean of every unconstrained number over a window differs by at most this "
        "from the window before.  0.02 is 2% of a positive parameter.",
        least=0,
    )
    jitter: float = option(
        0.3,
        "Standard deviation of the noise on the initial unconstrained numbers of every repeat but "
        "the first.",
        least=0,
    )
    seed: int = option(0, "Random seed.", least=0, most=2**32 - 1)

    def __post_init__(self) -> None:
        check_options(self)
