"""The clip of two flies: what the experiment promises of it.  Skipped where there is none."""

import numpy as np
import pytest

from jaxpf.papers.gonzales2011 import flies
from jaxpf.papers.gonzales2011.tables import fly_table

pytestmark = pytest.mark.slow

FRAMES = 40


@pytest.fixture(scope="module")
def fly(data_folder):
    if not (data_folder / flies.CLIP).is_dir():
        pytest.skip(f"no clip {flies.CLIP} in {data_folder}")
    return flies.read_fly(data_folder, num_frames=FRAMES)


def test_the_parts_begin_where_the_joints_are_marked(fly):
    poses, sizes, _ = flies.start_of(fly)
    apart = np.linalg.norm(flies.joints_at(poses, sizes) - fly.joints[0], axis=-1)
    # Where two joints lie nearly on top of one another the part is longer than their distance.
    long = np.append(True, np.linalg.norm(fly.joints[0, 1:] - fly.starts[0], axis=-1) > 8)
    assert apart[long].max() < 0.01
    assert apart.max() < 8


def test_the_trees_follow_the_fly(fly):
    found = flies.measure(fly, runs=flies.TOGETHER)
    assert set(found) == {"not moving", *flies.METHODS}
    error = {name: float(np.nanmean(distance)) for name, distance in found.items()}
    print(f"mean distance of the joints over {FRAMES} frames, pixels: {error}")
    for method in flies.METHODS:
        assert found[method].shape == (flies.TOGETHER, FRAMES, len(flies.SEGMENTS) + 1)
        assert error[method] < 0.8 * error["not moving"]
    # The fly walks; its trunk is followed, whatever becomes of its feet.
    trunk = {name: float(np.nanmean(distance[..., :3])) for name, distance in found.items()}
    assert max(trunk[method] for method in flies.METHODS) < 4
    table = fly_table(found)
    assert [label for label, _ in table.rows] == list(found)
