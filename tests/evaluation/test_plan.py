"""Plans: what may be asked, which configurations it means, and how two plans differ."""

import functools
import json

import numpy as np
import pytest
from refusals import message_of

from jaxpf import InputError
from jaxpf.boxes.target import BOXES
from jaxpf.contract.options import options_of
from jaxpf.evaluation import Plan
from jaxpf.evaluation.plan import complete, configurations
from jaxpf.evaluation.settings import describe_plan
from jaxpf.files.store import differences
from jaxpf.filters import filter_of
from jaxpf.targets import Start


def load(**given):
    raise AssertionError("a plan opens no scene")


SCENE = functools.partial(load, source="somewhere", seed=3)


def start(count):
    boxes = np.tile([10.0, 10.0, 5.0, 5.0], (count, 1))
    return Start(np.arange(count) + 1, boxes, boxes[:, 2:], (-1,) * count)


def found(plan, count=3, method="integral", asked=None):
    """The configurations of a plan on boxes, where "auto" stands for one method."""

    def settle(of, values, num_particles):
        if values["likelihood"] == "auto" and asked is not None:
            asked.append(num_particles)
        likelihood = method if values["likelihood"] == "auto" else values["likelihood"]
        return {**values, "likelihood": likelihood}

    return configurations(complete(plan, "boxes", start(count).parents), start(count), settle)


def test_methods_that_refuse_contours_are_left_out_unless_named():
    assert complete(Plan(SCENE), "boxes", (-1, -1)).methods == ("sir", "ps", "dps", "sps")
    assert complete(Plan(SCENE), "contours", (-1, -1)).methods == ("sir", "ps", "dps")
    assert complete(Plan(SCENE, methods=("sps",)), "contours", (-1, -1)).methods == ("sps",)


def test_configurations_are_methods_times_orderings_times_grid():
    plan = Plan(
        SCENE,
        orders=("shifts",),
        swaps=("combinatorial", "sorted"),
        grid={"sharpness": (20, 30), "bands": (2,), "num_particles": (100, 200)},
    )
    configurations = found(plan)
    orderings = [f"{c.method} {c.ordering}" for c in configurations[:7]]
    assert orderings == [
        *("SIR ", "PS 123", "PS 231", "PS 312", "DPS shifts", "SPS combinatorial", "SPS sorted")
    ]
    assert len(configurations) == 7 * 2 * 2
    assert configurations[2].variant == {"method": "ps", "order": (1, 2, 0)}
    assert len({(c.label, *c.parameters.values()) for c in configurations}) == 28
    defaults = options_of(BOXES.tracker, filter_of("dps").build)
    parameters = configurations[0].parameters
    assert set(parameters) == defaults.keys() - {"method", "order", "swap"}
    chosen = {"sharpness": 20.0, "num_particles": 100, "likelihood": "integral"}
    chosen["appearance"] = "colour"  # which bands say
    assert parameters == {name: defaults[name].default for name in parameters} | chosen
    # What compiles anew varies slowest.
    assert [c.parameters["num_particles"] for c in configurations] == [100] * 14 + [200] * 14


def test_part_trees_leave_out_dps_and_take_orders_level_by_level():
    plan = complete(Plan(SCENE), "parts", (-1, 2, 0))
    assert plan.methods == ("sir", "ps", "sps")
    boxes = np.zeros((3, 3))
    tree = Start(np.arange(3), boxes, np.ones((3, 2)), (-1, 2, 0))
    assert plan.grid["sharpness"] == (50.0,)
    labels = [c.label for c in configurations(plan, tree, lambda of, options, n: options)]
    assert labels == ["SIR", "PS 132", "SPS combinatorial"]


@pytest.mark.parametrize(
    ("given", "labels"),
    [
        ({}, ["SIR", "PS 123", "DPS shifts", "SPS combinatorial"]),
        # Orders count from 0, and none is listed twice.
        ({"methods": ["ps"], "orders": [(2, 0, 1), "shifts"]}, ["PS 312", "PS 123", "PS 231"]),
    ],
)
def test_orders_of_the_methods(given, labels):
    assert [c.label for c in found(Plan(SCENE, **given))] == labels


def test_auto_is_decided_once_and_merges_with_what_it_stands_for():
    plan = Plan(SCENE, methods=["sir"], grid={"likelihood": ["auto", "sampled"]})
    asked = []
    configurations = found(plan, 2, "sampled", asked)
    assert [c.parameters["likelihood"] for c in configurations] == ["sampled"]
    assert asked == [300]


@pytest.mark.parametrize(
    ("given", "named"),
    [
        ({"methods": ["sir", "pf"]}, "'pf'"),
        ({"methods": []}, "methods"),
        ({"methods": ["ps", "ps"]}, "ps twice"),
        ({"orders": ["3;1"]}, "'3;1'"),
        ({"swaps": ["shuffled"]}, "'shuffled'"),
        ({"target": "ghosts"}, "'ghosts'"),
        ({"tracks": {"a": "file.csv"}, "trackers": {"a": len}}, "'a'"),
        *(
            ({"tracks": {name: "file.csv"}}, "a tracker cannot be called")
            for name in ("two\nlines", "x" * 101, "bell\a", "dps", "")
        ),
        ({"runs": 0}, "runs = 0"),
        ({"runs": 10**8}, "runs = 100000000"),
        ({"seed": -1}, "seed = -1"),
        ({"seed": 2**32}, "seed = 4294967296"),
        ({"grid": {"sharpness": [20, 20.0]}}, "sharpness names 20 twice"),
        ({"grid": {"sharpness": []}}, "sharpness"),
        ({"grid": {"sharpness": [20, 0]}}, "sharpness = 0"),
        ({"grid": {"noise_pixels": [(1, np.inf, 0)]}}, "noise_pixels"),
        ({"grid": {"colour": ["red"]}}, "colour"),
        ({"methods": ["sir", "ps"], "grid": {"drift": ["clip"]}}, "drift"),
    ],
)
def test_what_cannot_be_asked_is_refused(given, named):
    assert named in message_of(Plan, SCENE, **given)


def test_an_option_of_another_target_is_refused_once_the_target_is_known():
    plan = Plan(SCENE, grid={"noise_joints": [(1, 1, 1)]})
    assert "noise_joints" in message_of(complete, plan, "boxes")


def test_orders_and_particles_that_do_not_fit_the_objects_are_refused():
    for order in [(0, 1), (0, 1, 1), (-1, 0, 1), (0, 1, 3), (0, 1, 2, 3)]:
        with pytest.raises(InputError, match=r"order|least 0"):
            found(Plan(SCENE, methods=["ps"], orders=[order]))
    assert "num_particles = 2" in message_of(found, Plan(SCENE, grid={"num_particles": [300, 2]}))


def test_what_was_asked_survives_json_and_names_the_scene(tmp_path):
    (tmp_path / "tracks.csv").write_text("frame,id,x,y,w,h\n")
    asked = describe_plan(Plan(SCENE, tracks={"theirs": tmp_path / "tracks.csv"}))
    assert json.loads(json.dumps(asked)) == asked
    assert asked["scene"]["source"] == "somewhere"
    assert asked["scene"]["seed"] == 3
    assert "runs" not in asked  # more runs may be added


def test_differences_name_the_value_before_and_after(tmp_path):
    file = tmp_path / "tracks.csv"

    def described(scene=SCENE, **grid):
        return describe_plan(Plan(scene, grid=grid, tracks={"theirs": file}))

    with pytest.raises(InputError, match=r"cannot read '.*tracks.csv'"):
        described()
    file.write_text("one")
    before = described(sharpness=[20])
    assert list(differences(before, before)) == []
    other = functools.partial(load, source="somewhere", seed=4, ids=[1, 2])
    assert list(differences(before, described(other, sharpness=[20, 25.5])))[:3] == [
        "scene: seed = 3, now 4",
        "scene: ids = nothing, now 1,2",
        "grid: sharpness = 20, now 20,25.5",
    ]
    file.write_text("two")
    (change,) = differences(before, described(sharpness=[20]))
    assert change.startswith("tracks: theirs: sha256 = ")


def test_an_option_says_what_it_is_an_option_of():
    def grid(**given):
        return complete(Plan(SCENE, methods=["sir"], grid=given), "boxes").grid

    both = ["colour", "discriminative"]
    told = grid(bands=[1, 2], noise_relative=[(0.1, 0.2, 0.01)])
    assert (told["appearance"], told["motion"]) == (("colour",), ("relative",))
    assert grid(appearance=both)["appearance"] == tuple(both)
    assert "bands" in message_of(grid, appearance=both, bands=[2])
    assert "exclusion" in message_of(grid, bands=[2], exclusion=["boxes"])
