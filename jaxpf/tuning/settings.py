"""Settings of the descent: steps, random numbers, stopping rule."""

import dataclasses
import math

from jaxpf.contract.errors import Argument, InputError, check_known

RANDOM_NUMBERS = ("fresh", "common")


@dataclasses.dataclass(frozen=True)
class Settings:
    """Settings of the descent.

    Attributes:
        steps: maximum number of steps per repeat.
        learning_rate: Adam's, on the unconstrained numbers; .1 changes a positive parameter by up
            to 10 % per step.
        runs: tracker runs per sequence and step.
        sequences_per_step: number of sequences per step, in rotation; None for all.
        random_numbers: "fresh" draws new random numbers at every step and minimises the expected
            loss.  "common" reuses those of the first step: the loss has no noise, but its minimum
            depends on these numbers.
        clip: maximum gradient norm; longer gradients are shortened to it.
        window: number of steps in a window; tuned values are means over the last one.
        tolerance: stop when the mean of every unconstrained number over the last window is within
            this of its mean over the window before: .02 is 2 % of a positive parameter.
        repeats: independent descents, whose spread shows how far values depend on chance.
        jitter: standard deviation of the noise added to the initial unconstrained numbers of every
            repeat but the first.
        seed: random seed.
    """

    steps: int = 150
    learning_rate: float = 0.1
    runs: int = 4
    sequences_per_step: int | None = None
    random_numbers: str = "fresh"
    clip: float = 10.0
    window: int = 20
    tolerance: float = 0.02
    repeats: int = 3
    jitter: float = 0.3
    seed: int = 0

    def __post_init__(self) -> None:
        for name in ("steps", "runs", "sequences_per_step", "window", "repeats"):
            value = getattr(self, name)
            if value is not None and value < 1:
                raise InputError(Argument(name, value), " must be at least 1.")
        for name in ("learning_rate", "clip"):
            value = getattr(self, name)
            if not 0 < value < math.inf:
                raise InputError(Argument(name, value), " must be positive and finite.")
        for name in ("tolerance", "jitter"):
            value = getattr(self, name)
            if not 0 <= value < math.inf:
                raise InputError(Argument(name, value), " must be finite and at least 0.")
        check_known("random_numbers ", self.random_numbers, RANDOM_NUMBERS)
        if not 0 <= self.seed < 2**32:
            raise InputError(Argument("seed", self.seed), f" must be between 0 and {2**32 - 1}.")
