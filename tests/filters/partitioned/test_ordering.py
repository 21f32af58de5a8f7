"""Orderings are small tables."""

import jax
import numpy as np
import pytest

from jaxpf import ordering

DEEP = [-1, 0, 0, 1, 2]
PS, DPS, SPS = ordering.ps([2, 0, 1]), ordering.dps(3), ordering.sps(DEEP)
KEPT = ordering.sps([-1, -1, 0, 1], exchange_roots=False)
BRANCHED, ALONE = ordering.branched([[0, 1], [1, 0]]), [False] * 5


def used(made):
    """Components that receive particles."""
    return int(np.count_nonzero(np.asarray(made.fractions)))


@pytest.mark.parametrize(
    ("made", "field", "expected"),
    [
        (ordering.sir(3), "resample_after", ALONE[:3]),  # never inside a frame
        (ordering.sir(3), "exchange_after", ALONE[:3]),
        (PS, "order", [[2, 0, 1]]),
        (PS, "rank", [[1, 2, 0]]),
        (PS, "resample_after", [True, True, False]),  # after every stage but the last
        (DPS, "order", [[0, 1, 2], [1, 2, 0], [2, 0, 1]]),
        (DPS, "fractions", np.full(3, 1 / 3)),
        (DPS, "literal", False),
        (ordering.dps(3, reassembly="literal"), "literal", True),
        (SPS, "order", [[0, 1, 2, 3, 4]]),
        (SPS, "level", [0, 1, 1, 2, 2]),
        (SPS, "resample_after", [True, False, True, False, False]),  # levels but the last
        # The root's level, too: its end notes who shares the root's draw.
        (SPS, "exchange_after", [True, False, True, False, True]),
        (SPS, "exchanged", [False, True, True, True, True]),
        (ordering.sps([2, 0, -1, 2]), "order", [[2, 0, 3, 1]]),  # whatever the numbers
        (ordering.sps([-1, 0, 1]), "exchanged", ALONE[:3]),  # levels of one part
        (KEPT, "exchanged", [False, False, True, True]),  # all but the roots
        (ordering.sps(DEEP, "none"), "exchanged", ALONE),
        (BRANCHED, "order", [[0, 1], [1, 0]]),
        (BRANCHED, "keeps_components", True),
    ],
)
def test_the_table_of_an_ordering(made, field, expected):
    found = np.asarray(getattr(made, field))
    if field in ("order", "rank"):  # of the first components
        found = found[: len(expected)]
    np.testing.assert_allclose(found, expected, rtol=1e-6)


def test_components_that_receive_particles():
    assert [used(made) for made in (ordering.sir(3), PS, SPS, DPS)] == [1, 1, 1, 3]


def test_dps_puts_every_partition_at_every_stage_once():
    order = np.asarray(ordering.dps(7).order)
    assert all(sorted(stage) == list(range(7)) for stage in order.T)


def test_an_exchanged_part_carries_all_that_hangs_from_it():
    carrier = np.asarray(SPS.carrier)
    # At the level of parts 1 and 2 (stages 1 and 2): 3 goes with 1, and 4 with 2.
    np.testing.assert_array_equal(carrier[1], [-1, 1, 2, 1, 2])
    np.testing.assert_array_equal(carrier[2], [-1, 1, 2, 1, 2])
    np.testing.assert_array_equal(carrier[4], [-1, -1, -1, 3, 4])


def test_orderings_of_one_size_have_one_structure():
    made = [
        ordering.sir(3),
        ordering.ps([2, 1, 0]),
        ordering.dps(3),
        ordering.dps(3, reassembly="literal"),
        *(ordering.sps([-1, 0, 0], swap) for swap in ordering.SWAPS),
    ]
    shapes = {str(jax.tree.map(lambda x: (x.shape, x.dtype, x.weak_type), one)) for one in made}
    assert len(shapes) == 1
    assert len({jax.tree.structure(one) for one in made}) == 1
