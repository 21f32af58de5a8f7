"""Parameters of the distracter scene, marking those that the paper specifies."""

import dataclasses

from scenes.parameters import check_parameters, require


@dataclasses.dataclass(frozen=True)
class DistracterParameters:
    """Parameters of the distracter scene; "paper" marks values from smith2004.

    Lengths are in pixels, colours in grey levels from 0 to 255, angles in degrees; frames count
    from 1, as in the paper.

    Attributes:
        num_frames: length of the sequence (paper: 25).
        frame_width: width of a frame (paper: 360).
        frame_height: height of a frame (paper: 288).
        fps: frames per second; it affects only playback.
        num_objects: number of objects, without the distracter (paper: 7).
        object_width: width of every object (the paper's real templates are 32 wide).
        object_height: height of every object (the paper's real templates are 33 to 42 high).
        motion_scale: standard deviation of the motion noise in u and in v per frame (paper: 3).
        momentum: b in x_t = x_{t-1} + b (x_{t-1} - x_{t-2}) + motion_scale * n (paper: .5).
        start_jitter: objects start at rest in cells of a grid, in shuffled order, each shifted from
            the centre of its cell by up to this share of the cell's free space.
        separation: minimum gap between the boxes of two objects, in every frame.  Trajectories
            that come closer or leave the frame are redrawn, so the motion is AR2 *conditional* on
            objects staying separate and in view.
        frame_margin: minimum gap between a box and the border of the frame.
        appear_frame: first frame with the distracter, exactly over object 1 (paper: 3).
        vanish_frame: first frame without it (paper: it "disappears in frame 9").
        lead_distance: distance between the centres of the distracter and of object 1 in the last
            frame with the distracter, which moves in a straight line at constant speed.  The faster
            it is, the fewer trackers follow it; the further it goes, the fewer return.
        leader_travel: object 1's trajectory is redrawn until its displacement while the
            distracter is shown is at least this long: it "re-emerges" elsewhere, with the
            "quicker motion" that the paper mentions.
        departure: object 1's trajectory is redrawn until its centre ends at least this far from
            where the distracter vanished, so that a tracker meets it in the last frame only by
            following it.
        likeness: share of the distracter's cells that have object 1's colours, in each half; the
            other cells have a colour that object 1 lacks.  At 1 the two look alike, at 0 they
            share no colour.
        cell_size: side of the square cells of which objects are mosaics.
        accent_share: share of the cells of each half that have the half's second colour.
        saturation: saturation of the objects' colours, 0 to 1.
        brightness: value (in HSV) of the objects' colours, 0 to 1.
        object_noise: standard deviation of the normal noise on the objects' pixels, redrawn in
            every frame, and once for the reference patches.
        background_mean: mean of the background.
        background_noise: standard deviation of the background's normal noise, independent in
            each channel.
        background_grain: side of the squares that share one value of the background noise.
    """

    num_frames: int = 25
    frame_width: int = 360
    frame_height: int = 288
    fps: float = 25.0
    num_objects: int = 7
    object_width: int = 32
    object_height: int = 42
    motion_scale: float = 3.0
    momentum: float = 0.5
    start_jitter: float = 0.5
    separation: float = 6.0
    frame_margin: float = 2.0
    appear_frame: int = 3
    vanish_frame: int = 9
    lead_distance: float = 45.0
    leader_travel: float = 15.0
    departure: float = 0.0
    likeness: float = 0.6
    cell_size: int = 4
    accent_share: float = 0.3
    saturation: float = 0.8
    brightness: float = 0.8
    object_noise: float = 12.0
    background_mean: float = 128.0
    background_noise: float = 45.0
    background_grain: int = 1

    def __post_init__(self) -> None:
        check_parameters(
            "distracter",
            self,
            above_0=("num_objects", "object_width", "cell_size", "background_grain"),
            shares=("start_jitter", "likeness", "accent_share", "saturation", "brightness"),
            signed=("momentum", "background_mean"),
            object_height=2,  # two halves
            appear_frame=1,  # counted from 1
        )
        later = f"must come after appear_frame = {self.appear_frame}"
        after = self.vanish_frame > self.appear_frame
        require("distracter", self, "vanish_frame", after, later)
