"""Episodes out of marks: whatever was lost, what is of one episode never counts as another's."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from serd_app.drives.episode_spans import EpisodeMark, marks_of, spans_of_marks
from serd_bag.errors import BagError

GAP_S = 0.5
STEADY_S = np.arange(0.0, 20.01, 0.1)
WITH_GAP_S = STEADY_S[(STEADY_S < 3.05) | (STEADY_S > 7.95)]


def start(time_s, number):
    return EpisodeMark("start", time_s, number)


def end(time_s, number, outcome="arrived"):
    return EpisodeMark("end", time_s, number, outcome=outcome)


def spans(*marks, pose_time_s=STEADY_S):
    """(number, start, end, outcome) of each episode; times to a tenth of a second."""
    found = spans_of_marks(marks, pose_time_s, GAP_S)
    return [(each.number, each.start_s, round(each.end_s, 6), each.outcome) for each in found]


def test_an_episode_taken_back_after_its_arrival_is_discarded_and_the_next_one_is_not():
    marks = (start(0.0, 1), end(4.0, 1), end(5.0, 1, "discarded"), start(6.0, 2), end(9.0, 2))
    assert spans(*marks) == [(1, 0.0, 4.0, "discarded"), (2, 6.0, 9.0, "arrived")]


def test_an_episode_taken_back_while_the_next_is_driven_leaves_that_alone():
    marks = (start(0.0, 1), end(4.0, 1), start(5.0, 2), end(6.0, 1, "discarded"), end(9.0, 2))
    assert spans(*marks) == [(1, 0.0, 4.0, "discarded"), (2, 5.0, 9.0, "arrived")]


def test_the_end_of_another_episode_cuts_the_open_one_off_before_the_gap_that_hid_its_own():
    marks = (start(1.0, 4), end(10.0, 7), start(11.0, 8), end(13.0, 8))
    assert spans(*marks, pose_time_s=WITH_GAP_S) == [
        (4, 1.0, 3.0, "cut_off"),
        (8, 11.0, 13.0, "arrived"),
    ]


def test_the_start_of_another_episode_does_so_as_well_and_so_does_the_end_of_the_recording():
    cut = (4, 1.0, 3.0, "cut_off")
    marks = (start(1.0, 4), start(10.0, 7), end(12.0, 7))
    assert spans(*marks, pose_time_s=WITH_GAP_S) == [cut, (7, 10.0, 12.0, "arrived")]
    assert spans(start(1.0, 4), pose_time_s=WITH_GAP_S) == [cut]


def test_a_gap_within_an_episode_whose_own_end_is_there_does_not_end_it():
    assert spans(start(1.0, 4), end(10.0, 4), pose_time_s=WITH_GAP_S) == [(4, 1.0, 10.0, "arrived")]


def test_without_a_gap_an_episode_is_cut_off_at_the_mark_that_is_not_its_own():
    assert spans(start(1.0, 4), end(10.0, 7)) == [(4, 1.0, 10.0, "cut_off")]
    assert spans(start(1.0, 4), start(10.0, 5)) == [
        (4, 1.0, 10.0, "cut_off"),
        (5, 10.0, 20.0, "cut_off"),
    ]


@pytest.mark.parametrize("poses_s", [np.zeros(0), np.array([0.5])])
def test_without_poses_after_its_start_an_open_episode_lasts_no_time(poses_s):
    assert spans(start(1.0, 4), pose_time_s=poses_s) == [(4, 1.0, 1.0, "cut_off")]


def test_a_start_within_a_gap_begins_nothing_that_can_be_told():
    marks = (start(5.0, 4), start(10.0, 5), end(12.0, 5))
    assert spans(*marks, pose_time_s=WITH_GAP_S)[0] == (4, 5.0, 5.0, "cut_off")


def test_a_number_that_comes_again_is_another_episode():
    first, second = (start(0.0, 0), end(2.0, 0)), (start(4.0, 0), end(6.0, 0, "timeout"))
    third = (start(8.0, 1), end(10.0, 1))
    assert spans(*first, *second, *third) == [
        (0, 0.0, 2.0, "arrived"),
        (1, 4.0, 6.0, "timeout"),
        (2, 8.0, 10.0, "arrived"),
    ]


def test_of_two_episodes_with_one_number_the_later_is_taken_back():
    marks = (start(0.0, 0), end(2.0, 0), start(4.0, 0), end(6.0, 0), end(7.0, 0, "discarded"))
    assert spans(*marks) == [(0, 0.0, 2.0, "arrived"), (1, 4.0, 6.0, "discarded")]


def test_marks_sent_again_count_once():
    marks = (start(0.0, 0), end(2.0, 0), start(4.0, 1), end(6.0, 1))
    assert spans(*(each for mark in marks for each in (mark, mark))) == spans(*marks)


@given(
    numbers=st.lists(st.integers(0, 3), min_size=1, max_size=8),
    lost=st.sets(st.integers(0, 15)),
    seed=st.integers(0, 3),
)
def test_no_moment_of_one_episode_is_ever_given_the_outcome_of_another(numbers, lost, seed):
    """Every lost mark takes half a second of poses with it; each episode is 1 s of 2 s."""
    outcomes = [f"outcome {row}" for row in range(len(numbers))]
    marks, kept_s = [], np.arange(0.0, 2.0 * len(numbers), 0.1)
    for row, (number, outcome) in enumerate(zip(numbers, outcomes, strict=True)):
        marks += [start(2.0 * row, number), end(2.0 * row + 1.0, number, outcome)]
    for mark in (marks[each] for each in lost if each < len(marks)):
        kept_s = kept_s[np.abs(kept_s - mark.time_s) > 0.35]
    heard = [mark for row, mark in enumerate(marks) if row not in lost]
    shuffled = [heard[row] for row in np.random.default_rng(seed).permutation(len(heard))]
    found = spans_of_marks(shuffled, kept_s, GAP_S)
    assert len({span.number for span in found}) == len(found)
    for span in found:
        driven_s = kept_s[(kept_s >= span.start_s) & (kept_s <= span.end_s)]
        own = set((driven_s[driven_s < span.end_s - 1e-9] // 2.0).astype(int).tolist())
        if span.outcome != "cut_off":
            row = outcomes.index(span.outcome)
            assert span.end_s == 2.0 * row + 1.0
            assert len(own) == 1 or numbers[min(own)] == numbers[row]
        else:
            assert len(own) <= 1


def test_marks_are_read_by_name_and_their_numbers_checked(messages):
    assert marks_of(messages.mark(1.5, "end", 7, "timeout")) == [
        EpisodeMark("end", 1.5, 7, outcome="timeout")
    ]
    assert marks_of(messages.mark(1.0, "start", 7), 2 * 10**9) == [EpisodeMark("start", 2.0, 7)]
    assert marks_of(messages.mark(1.5, "pause", 7)) == []
    with pytest.raises(BagError, match=r"must carry the episode's number, .*, got '12345678901'"):
        marks_of(messages.mark(1.5, "end", 12345678901))


def test_an_episode_that_was_discarded_is_kept_by_a_later_mark_that_saves_it():
    marks = (start(0.0, 1), end(4.0, 1, "discarded"), end(6.0, 1, "saved"), start(7.0, 2))
    assert spans(*marks)[0] == (1, 0.0, 4.0, "saved")
