"""Plans: what may be asked, which configurations it means, and how two plans differ."""

import functools
import json

import numpy as np
import pytest

from jaxpf import InputError
from jaxpf.evaluation import Plan
from jaxpf.evaluation import plan as plans
from jaxpf.evaluation.plan import differences, order_label, order_of_label
from jaxpf.filters import resampling
from jaxpf.filters.partitioned import ordering
from jaxpf.models.likelihoods._references import METHODS
from jaxpf.targets import boxes


def load(**given):
    raise AssertionError("a plan opens no scene")


SCENE = functools.partial(load, source="somewhere", seed=3)


def never():
    raise AssertionError("nothing was left to be chosen")


def test_the_names_are_those_of_the_library():
    assert plans.METHODS == boxes.METHODS
    assert plans.SWAPS == ordering.SWAPS
    assert set(plans.SCHEMES) == set(resampling.SCHEMES)
    assert ("auto", *METHODS) == plans.LIKELIHOODS
    assert plans.DEFAULT_SCALE == boxes.DEFAULT_SCALE


def test_configurations_are_methods_times_orderings_times_grid():
    plan = Plan(
        SCENE,
        swaps=("combinatorial", "sorted"),
        sharpness=(20, 30),
        particles=(100, 200),
        tracks={"theirs": "file.csv"},
    )
    found = plan.configurations(3, lambda: "integral")
    orderings = [(c.method, c.ordering) for c in found[:7]]
    assert orderings == [
        ("SIR", ""),
        ("PS", "123"),
        ("PS", "231"),
        ("PS", "312"),
        ("DPS", "shifts"),
        ("SPS", "combinatorial"),
        ("SPS", "sorted"),
    ]
    assert len(found) == 7 * 2 * 2 + 1
    assert found[-1].label == "theirs"
    assert found[-1].is_imported
    assert len({(c.label, *c.parameters.values()) for c in found}) == len(found)
    assert found[0].parameters == {
        "sharpness": 20.0,
        "scale": "4,2,0.003",
        "particles": 100,
        "resampling": "systematic",
        "parts": 2,
        "likelihood": "integral",
    }
    # What compiles anew varies slowest.
    assert [c.parameters["particles"] for c in found[:-1]] == [100] * 14 + [200] * 14


def test_orders_are_permutations_counted_from_1_and_none_twice():
    plan = Plan(SCENE, methods=["ps"], orders=["3, 1,2", "shifts"], likelihood=["sampled"])
    assert [c.ordering for c in plan.configurations(3, never)] == ["312", "123", "231"]


def test_labels_of_orders_are_read_back():
    for places in ([1], [3, 1, 2], list(range(12, 0, -1))):
        label = order_label(places)
        assert order_of_label(label) == [place - 1 for place in places]
    assert order_label(range(1, 11)) == "1-2-3-4-5-6-7-8-9-10"


def test_auto_is_decided_once_and_merges_with_what_it_stands_for():
    plan = Plan(SCENE, methods=["sir"], likelihood=["auto", "sampled"], sharpness=[1, 2])
    asked = []
    found = plan.configurations(2, lambda: asked.append(1) or "sampled")
    assert [c.parameters["likelihood"] for c in found] == ["sampled"] * 2
    assert asked == [1]


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ({"methods": ["sir", "pf"]}, "methods: 'pf' is unknown; choose among sir, ps, dps, sps"),
        ({"methods": []}, "methods names none; choose among sir, ps, dps, sps"),
        ({"methods": ["ps", "ps"]}, "methods names ps twice"),
        ({"swaps": ["shuffled"]}, "swaps: 'shuffled' is unknown; choose among none, random,"),
        ({"resampling": ["none"]}, "resampling: 'none' is unknown; choose among systematic,"),
        ({"likelihood": ["gaussian"]}, "likelihood: 'gaussian' is unknown; choose among auto,"),
        ({"orders": ["3;1"]}, "orders: '3;1' is no order; write 'shifts', or the objects"),
        ({"orders": []}, "orders is empty; give at least one value"),
        ({"sharpness": [20, 0]}, "sharpness = 0 must be positive and finite"),
        ({"sharpness": [np.nan]}, "sharpness = nan must be positive and finite"),
        ({"sharpness": [np.inf]}, "sharpness = inf must be positive and finite"),
        ({"sharpness": [20, 20.0]}, "sharpness names 20 twice"),
        ({"sharpness": []}, "sharpness is empty"),
        ({"particles": [0]}, "particles = 0 must be a whole number from 1"),
        ({"particles": [2**31]}, "particles = 2147483648 must be a whole number from 1"),
        ({"particles": [1.5]}, "particles = 1.5 must be a whole number"),
        ({"parts": [0]}, "parts = 0 must be a whole number from 1"),
        ({"scale": [(1, 2)]}, "scale = 1,2 must be three finite numbers"),
        ({"scale": [(1, -2, 0)]}, "scale = 1,-2,0 must be three finite numbers"),
        ({"scale": [(1, np.inf, 0)]}, "scale = 1,inf,0 must be three finite numbers"),
        ({"runs": 0}, "runs = 0 must be a whole number from 1"),
        ({"runs": True}, "runs = True must be a whole number from 1"),
        ({"seed": -1}, "seed = -1 must be a whole number from 0 to 4294967295"),
        ({"seed": 2**32}, "seed = 4294967296 must be a whole number from 0 to 4294967295"),
        ({"tracks": {"dps": "file.csv"}}, "tracks cannot be called 'dps'"),
        ({"tracks": {"": "file.csv"}}, "tracks cannot be called ''"),
    ],
)
def test_what_cannot_be_asked_is_refused(given, sentence):
    with pytest.raises(InputError) as error:
        Plan(SCENE, **given)
    assert sentence in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("order", ["1,2", "1,2,2", "0,1,2", "1,2,4", "1,2,3,4"])
def test_an_order_that_is_no_permutation_of_the_objects_is_refused(order):
    plan = Plan(SCENE, methods=["ps"], orders=[order])
    with pytest.raises(InputError, match="is not a permutation of the 3 object"):
        plan.configurations(3, lambda: "integral")


def test_fewer_particles_than_components_are_refused():
    plan = Plan(SCENE, particles=[300, 2])
    with pytest.raises(InputError, match="particles = 2 is fewer than the 3 components of dps"):
        plan.configurations(3, lambda: "integral")


def test_what_was_asked_survives_json_and_names_the_scene(tmp_path):
    (tmp_path / "tracks.csv").write_text("frame,id,x,y,w,h\n")
    asked = Plan(SCENE, tracks={"theirs": tmp_path / "tracks.csv"}).asked()
    assert json.loads(json.dumps(asked)) == asked
    assert asked["scene"]["source"] == "somewhere"
    assert asked["scene"]["seed"] == 3
    assert "runs" not in asked  # more runs may be added


def test_differences_name_the_value_before_and_after(tmp_path):
    file = tmp_path / "tracks.csv"
    file.write_text("one")
    before = Plan(SCENE, tracks={"theirs": file}).asked()
    assert list(differences(before, before)) == []
    file.write_text("two")
    (change,) = differences(before, Plan(SCENE, tracks={"theirs": file}).asked())
    assert change.startswith("tracks: theirs: sha256 = ")
    other = functools.partial(load, source="somewhere", seed=4, ids=[1, 2])
    after = Plan(other, sharpness=[20, 25.5], tracks={"theirs": file}).asked()
    changes = list(differences(before, after))
    assert changes[:3] == [
        "scene: seed = 3, now 4",
        "scene: ids = nothing, now 1,2",
        "sharpness = 20, now 20,25.5",
    ]


def test_tracks_that_cannot_be_read_are_refused(tmp_path):
    with pytest.raises(InputError, match=r"cannot read '.*missing.csv'"):
        Plan(SCENE, tracks={"theirs": tmp_path / "missing.csv"}).asked()
