"""Who starts and who ends, by hand-made detections."""

import numpy as np

from jaxpf.detections import Rules, lifetimes
from jaxpf.detections.lifetimes import EMPTY

SHAPE = (100, 200)
SHIFT = np.array([1.0, 0, 0, 0])
NONE = np.zeros((0, 4))
HERE, THERE, ELSEWHERE = (np.array([[x, 20.0, 10, 20]]) for x in (10.0, 60.0, 120.0))


class Course:
    """Frames one after the other; whoever lives stays where he started, unless moved."""

    def __init__(self, capacity=2, **rules):
        self.rules = Rules(capacity=capacity, **({"min_hits": 2, "max_age": 2} | rules))
        self.living = lifetimes.start_empty(capacity)
        self.boxes = np.full((capacity, 4), np.nan)
        self.lost = np.zeros(capacity, bool)

    def frame(self, detections, named=()):
        seen = None if detections is None else np.reshape(detections, (-1, 4))
        self.living, changes = lifetimes.advance(
            self.living, self.boxes, self.lost, seen, named, SHAPE, self.rules
        )
        for new in changes.started:
            self.boxes[new.slot] = new.box
        return changes

    def ids(self):
        return self.living.ids.tolist()


def test_one_starts_when_detected_often_enough_and_not_before():
    course = Course(min_hits=3)
    assert course.frame(HERE).started == []
    assert course.frame(HERE + SHIFT).started == []
    (new,) = course.frame(HERE + 2 * SHIFT).started
    assert (new.slot, new.id) == (0, 1)
    np.testing.assert_array_equal(new.box, HERE[0] + 2 * SHIFT)
    # Who is tracked is not born again.
    assert all(course.frame(HERE).started == [] for _ in range(6))
    assert course.ids() == [1, EMPTY]


def test_false_alarms_that_nothing_confirms_start_nobody():
    course = Course()
    for place in (HERE, THERE, ELSEWHERE, NONE, NONE, NONE, HERE):
        assert course.frame(place).started == []


def test_one_ends_after_so_many_frames_without_a_detection_of_his_own():
    course = Course()
    course.frame(np.concatenate([HERE, THERE]))
    assert len(course.frame(np.concatenate([HERE, THERE])).started) == 2
    assert course.frame(HERE).ended == []
    course.frame(np.concatenate([HERE, THERE]))  # seen again: counted from the beginning
    for _ in range(2):
        assert course.frame(HERE).ended == []
    (gone,) = course.frame(HERE).ended
    assert (gone.slot, gone.id) == (1, 2)
    assert "3 frames in a row" in gone.reason
    assert course.ids() == [1, EMPTY]


def test_one_ends_whom_a_detector_that_rests_between_does_not_find():
    course = Course()
    course.frame(None, named=[(1, HERE[0]), (2, THERE[0])])
    ended = []
    for _ in range(3):
        ended += course.frame(HERE).ended
        assert [course.frame(None).ended for _ in range(3)] == [[]] * 3
    (gone,) = ended
    assert (gone.id, gone.reason) == (2, "not detected in 3 frames with detections in a row")
    assert course.ids() == [1, EMPTY]


def test_two_on_one_detection_cannot_both_live():
    course = Course()
    course.frame(None, named=[(1, HERE[0]), (2, HERE[0] + SHIFT)])
    ended = [gone.id for _ in range(3) for gone in course.frame(HERE).ended]
    assert ended == [2]


def test_one_without_likelihood_ends_though_he_is_detected():
    course = Course()
    course.frame(NONE, named=[(1, HERE[0])])
    course.lost[0] = True
    ended = [gone.id for _ in range(3) for gone in course.frame(HERE).ended]
    assert ended == [1]


def test_one_who_leaves_the_picture_ends_at_once_and_starts_nobody_outside():
    course = Course()
    course.frame(NONE, named=[(4, HERE[0])])
    course.boxes[0] = [196, 20, 10, 20]
    (gone,) = course.frame(course.boxes[0]).ended
    assert (gone.id, gone.reason) == (4, "left the picture")
    assert all(course.frame([196, 20, 10, 20]).started == [] for _ in range(4))


def test_without_a_detector_to_be_undetected_means_nothing():
    course = Course()
    course.frame(None, named=[(1, HERE[0])])
    assert all(course.frame(None).ended == [] for _ in range(20))
    course.lost[0] = True
    ended = [gone.reason for _ in range(3) for gone in course.frame(None).ended]
    assert ended == ["without likelihood in 3 frames in a row"]


def test_slots_are_used_again_and_ids_never():
    course, given, slots = Course(capacity=1, max_age=0, min_hits=1), [], []
    for place in (HERE, NONE, THERE, NONE, HERE, ELSEWHERE):
        for new in course.frame(place).started:
            given.append(new.id)
            slots.append(new.slot)
    assert given == [1, 2, 3, 4]
    assert set(slots) == {0}


def test_a_number_that_a_user_gave_is_given_to_nobody_else():
    course = Course(min_hits=1)
    course.living = lifetimes.start_empty(2, last_id=7)
    course.frame(NONE, named=[(7, HERE[0])])
    (new,) = course.frame(np.concatenate([HERE, THERE])).started
    assert new.id == 8


def test_who_finds_no_slot_is_told_once_and_starts_when_one_is_free():
    course = Course(capacity=1, min_hits=2)
    course.frame(HERE)
    course.frame(HERE)
    refused = [course.frame(np.concatenate([HERE, THERE])).refused for _ in range(4)]
    assert [len(each) for each in refused] == [0, 1, 0, 0]
    assert "larger capacity" in refused[1][0].reason
    np.testing.assert_array_equal(refused[1][0].box, THERE[0])
    started = [new for _ in range(3) for new in course.frame(THERE).started]
    assert [new.id for new in started] == [2]


def test_a_named_one_goes_before_a_detected_one_and_is_refused_by_name():
    course = Course(capacity=1, min_hits=1)
    changes = course.frame(HERE, named=[(5, THERE[0]), (6, ELSEWHERE[0])])
    assert [new.id for new in changes.started] == [5]
    assert [refusal.id for refusal in changes.refused] == [EMPTY, 6]


def test_who_was_born_must_be_confirmed_anew_where_the_tracker_lost_him():
    course = Course(min_hits=2)
    course.frame(HERE)
    course.frame(HERE)
    course.boxes[0] = ELSEWHERE[0]  # the tracker has gone astray
    assert course.frame(HERE).started == []
    assert [new.id for new in course.frame(HERE).started] == [2]


def test_who_gets_the_slot_of_one_who_just_ended_starts_afresh():
    course = Course(capacity=1, min_hits=1, max_age=1)
    course.frame(HERE)
    course.frame(NONE)
    changes = course.frame(THERE)
    assert [(len(changes.ended), new.id) for new in changes.started] == [(1, 2)]
    assert course.frame(NONE).ended == []


def test_of_two_who_are_ready_on_the_same_object_one_starts():
    course = Course(min_hits=1, capacity=4)
    twice = np.concatenate([HERE, HERE + SHIFT / 2, THERE])
    assert [new.id for new in course.frame(twice).started] == [1, 2]
    np.testing.assert_array_equal(course.boxes[:2, 0], [10, 60])
    assert all(course.frame(twice).started == [] for _ in range(5))
