"""Orderings are small tables; wrong ones are refused in one sentence."""

import jax
import numpy as np

from jaxpf import ordering

DEEP = [-1, 0, 0, 1, 2]


def used(made):
    """Components that receive particles."""
    return int(np.count_nonzero(np.asarray(made.fractions)))


def test_sir_never_resamples_inside_a_frame():
    made = ordering.sir(3)
    assert used(made) == 1
    assert not np.asarray(made.resample_after).any()
    assert not np.asarray(made.exchange_after).any()


def test_ps_resamples_after_every_stage_but_the_last():
    made = ordering.ps([2, 0, 1])
    np.testing.assert_array_equal(made.order[0], [2, 0, 1])
    np.testing.assert_array_equal(made.rank[0], [1, 2, 0])
    np.testing.assert_array_equal(made.resample_after, [True, True, False])
    assert used(made) == 1


def test_dps_gives_every_component_a_circular_shift():
    made = ordering.dps(3)
    np.testing.assert_array_equal(made.order, [[0, 1, 2], [1, 2, 0], [2, 0, 1]])
    np.testing.assert_allclose(made.fractions, np.full(3, 1 / 3), rtol=1e-6)
    assert not made.literal


def test_dps_puts_every_partition_at_every_stage_once():
    order = np.asarray(ordering.dps(7).order)
    assert all(sorted(stage) == list(range(7)) for stage in order.T)


def test_literal_reassembly_is_a_traced_flag():
    assert ordering.dps(3, reassembly="literal").literal


def test_sps_resamples_after_every_level_but_the_last():
    made = ordering.sps(DEEP)
    np.testing.assert_array_equal(made.order[0], [0, 1, 2, 3, 4])
    np.testing.assert_array_equal(made.level, [0, 1, 1, 2, 2])
    np.testing.assert_array_equal(made.resample_after, [True, False, True, False, False])
    # The root's level, too: its end notes who shares the root's draw.
    np.testing.assert_array_equal(made.exchange_after, [True, False, True, False, True])
    np.testing.assert_array_equal(made.exchanged, [False, True, True, True, True])


def test_sps_goes_level_by_level_whatever_the_numbers_of_the_parts():
    made = ordering.sps([2, 0, -1, 2])
    np.testing.assert_array_equal(made.order[0], [2, 0, 3, 1])


def test_a_level_with_one_part_exchanges_nothing():
    made = ordering.sps([-1, 0, 1])
    assert not np.asarray(made.exchanged).any()


def test_an_exchanged_part_carries_all_that_hangs_from_it():
    carrier = np.asarray(ordering.sps(DEEP).carrier)
    # At the level of parts 1 and 2 (stages 1 and 2): 3 goes with 1, and 4 with 2.
    np.testing.assert_array_equal(carrier[1], [-1, 1, 2, 1, 2])
    np.testing.assert_array_equal(carrier[2], [-1, 1, 2, 1, 2])
    np.testing.assert_array_equal(carrier[4], [-1, -1, -1, 3, 4])


def test_exchange_roots_false_leaves_only_the_roots_alone():
    made = ordering.sps([-1, -1, 0, 1], exchange_roots=False)
    np.testing.assert_array_equal(made.exchanged, [False, False, True, True])


def test_swap_none_exchanges_nothing():
    assert not np.asarray(ordering.sps(DEEP, "none").exchanged).any()


def test_particles_of_a_branched_ordering_keep_their_components():
    made = ordering.branched([[0, 1], [1, 0]])
    assert made.keeps_components
    np.testing.assert_array_equal(made.order[:2], [[0, 1], [1, 0]])


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


def test_tree_levels_are_depths_below_the_root():
    assert ordering.tree_levels((1, 2, -1, -1)) == [2, 1, 0, 0]


def test_check_tree_returns_plain_ints():
    assert ordering.check_tree(np.array([-1, 0])) == (-1, 0)
