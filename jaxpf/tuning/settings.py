"""How to tune: steps, random numbers, when to stop."""

import dataclasses
import math

from jaxpf.contract.errors import InputError, check_known

RANDOM_NUMBERS = ("fresh", "common")


@dataclasses.dataclass(frozen=True)
class Settings:
    """How the loss is descended.

    Attributes:
        steps: at most, per repeat.
        learning_rate: of Adam on the free numbers; .1 changes a positive parameter by up to 10 %
            per step.
        runs: of the tracker per sequence and step.
        sequences_per_step: number of sequences per step, in turn; None for all.
        random_numbers: "fresh" draws new ones at every step, so that the loss is descended in
            expectation; "common" keeps those of the first, so that the loss is a function without
            noise, whose minimum belongs to these numbers.
        clip: largest norm of a gradient; longer ones are shortened to it.
        window: steps of a window; tuned values are means over the last one.
        tolerance: stop when no free number's mean over the last window differs by more than this
            from its mean over the window before: .02 is 2 % of a positive parameter.
        repeats: independent descents, whose spread shows how far values depend on chance.
        jitter: standard deviation of the noise on the free numbers with which every repeat but
            the first starts.
        seed: of all random numbers.
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
                raise InputError(f"{name} = {value} must be at least 1.")
        for name in ("learning_rate", "clip"):
            value = getattr(self, name)
            if not 0 < value < math.inf:
                raise InputError(f"{name} = {value} must be positive and finite.")
        for name in ("tolerance", "jitter"):
            value = getattr(self, name)
            if not 0 <= value < math.inf:
                raise InputError(f"{name} = {value} must be finite and at least 0.")
        check_known("random_numbers ", self.random_numbers, RANDOM_NUMBERS)
        if not 0 <= self.seed < 2**32:
            raise InputError(f"seed = {self.seed} must be between 0 and {2**32 - 1}.")
