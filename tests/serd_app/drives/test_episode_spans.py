"""Episodes out of marks: whatever was lost, what is of one episode never counts as another's."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from serd_app.drives.drive import EpisodeMark, EpisodeSpan, marks_of, spans_of_marks, without_pauses
from serd_bag.errors import BagError

GAP_S = 0.5
STEADY_S = np.arange(0.0, 20.01, 0.1)
WITH_GAP_S = STEADY_S[(STEADY_S < 3.05) | (STEADY_S > 7.95)]


def start(time_s, number):
    return EpisodeMark("start", time_s, number)


def end(time_s, number, outcome="arrived"):
    return EpisodeMark("end", time_s, number, outcome=outcome)


def marks_in(text):
    """`start 1 at 0`, or an outcome in place of `start`, with commas between."""
    for word, number, _, time_s in map(str.split, text.split(", ")):
        make = [float(time_s), int(number)]
        yield start(*make) if word == "start" else end(*make, word)


@pytest.mark.parametrize(
    ("text", "pose_time_s", "expected"),
    [
        # taken back after its arrival; while the next is driven; then kept after all
        ("start 1 at 0, arrived 1 at 4, discarded 1 at 5, start 2 at 6, arrived 2 at 9", STEADY_S,
         "1: 0-4 discarded, 2: 6-9 arrived"),
        ("start 1 at 0, arrived 1 at 4, start 2 at 5, discarded 1 at 6, arrived 2 at 9", STEADY_S,
         "1: 0-4 discarded, 2: 5-9 arrived"),
        ("start 1 at 0, discarded 1 at 4, saved 1 at 6", STEADY_S, "1: 0-4 saved"),
        # cut off before the gap by the end or start of another one, or the end of the recording
        ("start 4 at 1, arrived 7 at 10, start 8 at 11, arrived 8 at 13", WITH_GAP_S,
         "4: 1-3 cut_off, 8: 11-13 arrived"),
        ("start 4 at 1, start 7 at 10, arrived 7 at 12", WITH_GAP_S,
         "4: 1-3 cut_off, 7: 10-12 arrived"),
        ("start 4 at 1", WITH_GAP_S, "4: 1-3 cut_off"),
        ("start 4 at 1, arrived 4 at 10", WITH_GAP_S, "4: 1-10 arrived"),
        ("start 4 at 5, start 5 at 10, arrived 5 at 12", WITH_GAP_S,
         "4: 5-5 cut_off, 5: 10-12 arrived"),
        # without a gap, at the mark that is not its own or at the last pose
        ("start 4 at 1, arrived 7 at 10", STEADY_S, "4: 1-10 cut_off"),
        ("start 4 at 1, start 5 at 10", STEADY_S, "4: 1-10 cut_off, 5: 10-20 cut_off"),
        ("start 4 at 1", np.zeros(0), "4: 1-1 cut_off"),
        ("start 4 at 1", np.array([0.5]), "4: 1-1 cut_off"),
        # a number that comes again is another episode, which is the one taken back
        ("start 0 at 0, arrived 0 at 2, start 0 at 4, timeout 0 at 6, start 1 at 8, arrived 1 at 9",
         STEADY_S, "0: 0-2 arrived, 1: 4-6 timeout, 2: 8-9 arrived"),
        ("start 0 at 0, arrived 0 at 2, start 0 at 4, arrived 0 at 6, discarded 0 at 7", STEADY_S,
         "0: 0-2 arrived, 1: 4-6 discarded"),
    ],
)  # fmt: skip
def test_marks_become_episodes_and_marks_sent_again_count_once(text, pose_time_s, expected):
    marks = list(marks_in(text))
    for sent in (marks, [mark for mark in marks for _ in range(2)]):
        spans = spans_of_marks(sent, pose_time_s, GAP_S)
        rows = (f"{s.number}: {s.start_s:g}-{round(s.end_s, 6):g} {s.outcome}" for s in spans)
        assert ", ".join(rows) == expected


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
    for mark in (marks[row] for row in lost if row < len(marks)):
        kept_s = kept_s[np.abs(kept_s - mark.time_s) > 0.35]
    heard = [mark for row, mark in enumerate(marks) if row not in lost]
    shuffled = [heard[row] for row in np.random.default_rng(seed).permutation(len(heard))]
    found = spans_of_marks(shuffled, kept_s, GAP_S)
    assert len({span.number for span in found}) == len(found)
    for span in found:
        driven_s = kept_s[(kept_s >= span.start_s) & (kept_s <= span.end_s)]
        own = set((driven_s[driven_s < span.end_s - 1e-9] // 2.0).astype(int).tolist())
        if span.outcome == "cut_off":
            assert len(own) <= 1
            continue
        row = outcomes.index(span.outcome)
        assert span.end_s == 2.0 * row + 1.0
        assert len(own) == 1 or numbers[min(own)] == numbers[row]


def test_marks_are_read_by_name_and_their_numbers_checked(messages):
    timeout = EpisodeMark("end", 1.5, 7, outcome="timeout")
    assert marks_of(messages.mark(1.5, "end", 7, "timeout")) == [timeout]
    assert marks_of(messages.mark(1.0, "start", 7), 2 * 10**9) == [EpisodeMark("start", 2.0, 7)]
    assert marks_of(messages.mark(1.5, "pause", 7)) == []
    with pytest.raises(BagError, match=r"must carry the episode's number, .*, got '12345678901'"):
        marks_of(messages.mark(1.5, "end", 12345678901))


@pytest.mark.parametrize(
    ("pause_s", "expected"),
    [
        *((pause_s, [(0, 0.0, 10.0), (1, 20.0, 30.0)]) for pause_s in (-1.0, 15.0, 31.0, 35.0)),
        (5.2, [(0, 0.0, 5.0), (2, 5.5, 10.0), (1, 20.0, 30.0)]),
    ],
)
def test_a_pause_divides_the_episode_that_it_is_in_and_no_other(pause_s, expected):
    spans = [EpisodeSpan(0, 0.0, 10.0, "arrived"), EpisodeSpan(1, 20.0, 30.0, "arrived")]
    found = without_pauses(spans, np.arange(0.0, 33.5, 0.5), np.array([pause_s]))
    assert [(each.number, each.start_s, each.end_s) for each in found] == expected
    assert without_pauses(spans, np.zeros(0), np.array([pause_s])) == tuple(spans)
