"""The figures that eskil2014 publishes, as data.

Eskil, "Factored particle filtering with dependent and constrained partition dynamics for tracking
deformable objects".
"""

from typing import NamedTuple


class Sequence(NamedTuple):
    """One of the paper's three sequences.

    Attributes:
        scene: our synthetic substitute.
        frames: its number of frames.
        scale: sigma_t, pixels of the paper's film.
        size: width of our film divided by the width of the paper's.
    """

    scene: str
    frames: int
    scale: float
    size: float = 1.0

    @property
    def scale_here(self) -> float:
        """sigma_t, pixels of our film."""
        return self.size * self.scale


SEQUENCES = {
    "platty": Sequence("fish", 110, 10.0, size=0.5),
    "skydiving": Sequence("skydivers", 300, 5.0),
    "face": Sequence("face", 127, 5.0),
}
#: M of PFFL; sigma_o.
PFFL_PARTICLES = 50
SIGMA = 0.1

#: Points of the fish near their true positions at the end, out of 12 (section 4.1).
KEPT_PFFL, KEPT_PROPOSED = 7, 12
#: Bound on most errors of the skydiver relative to his length.
SKYDIVER_MOSTLY = 0.2
#: Frames after which PFFL's curve parts from the proposed method's (figures 7 and 10).
PARTING = {"skydivers": 50, "face": 85}
#: Frame from which SPOT is lost on the skydivers (figure 7).
SPOT_LOST = 75
#: Frames of the fish before PFFL's points drift ("as early as frame 15"), and after its curve parts
#: ("from frame 20"); errors begin with frame 1.
FISH_TOGETHER, FISH_PARTED = slice(0, 14), slice(19, 30)
#: Middle frames of the three blinks in our synthetic face (scenes.face).
BLINKS = (22, 68, 108)
#: Frames in which the mouth smiles.
SMILE = (56, 95)
