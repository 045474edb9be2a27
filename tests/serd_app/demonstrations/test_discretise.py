"""Decisions from drives: hand-made cases, and laws that hold for every drive."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from serd_app.demonstrations import discretise
from serd_app.demonstrations.demonstrations import (
    demonstrations_of_bag,
)
from serd_app.demonstrations.discretise import (
    OFF_GRID,
    REPEATED,
    UNEXPLAINED,
    DiscretisationReport,
    decisions_from_drive,
    joined_reports,
)
from serd_app.drives.episode_spans import EpisodeSpan
from serd_app.drives.recorded_drive import NOT_FINITE, RecordedDrive
from serd_app.drives.sessions import Session, read_drives
from serd_bag.errors import BagError
from serd_bag.writer import BagWriter
from serd_core.grid.grid import Action, Grid
from support.bag_messages import OWN_TOPICS, write_bag

PERIOD_S = 2.0
GRID = Grid((0.0, 0.0), 1.0, np.array([[1, 1, 1, 1], [1, 1, 0, 1], [1, 1, 1, 1]], dtype=bool))


def drive(places, intents, end_s=None, outcome="arrived"):
    """A drive through `places` (x, y), one per second, with intents (time, action)."""
    time_s = np.arange(len(places), dtype=float)
    fine_s = np.arange(0.0, time_s[-1] + 1e-9, 0.25)
    x, y = np.array(places, dtype=float).T
    return RecordedDrive(
        pose_time_s=fine_s,
        position_m=np.stack([np.interp(fine_s, time_s, x), np.interp(fine_s, time_s, y)], axis=1),
        intent_time_s=np.array([time for time, _ in intents], dtype=float),
        intent_action=np.array([int(action) for _, action in intents], dtype=np.int64),
        episodes=(EpisodeSpan(3, 0.0, time_s[-1] if end_s is None else end_s, outcome),),
        source="hand",
    )


def report_of(n_decisions, n_episodes, n_diagonal, n_far, dropped=(), *others, **counts):
    """others: the counts from `n_bad_poses` on."""
    counts |= zip(list(DiscretisationReport.model_fields)[5:], others, strict=False)
    return DiscretisationReport(
        n_decisions=n_decisions, n_episodes=n_episodes, n_diagonal=n_diagonal, n_far=n_far,
        dropped=dict(dropped), **counts,
    )  # fmt: skip


def faults(report):
    """(diagonal, far, unexplained, all) moves."""
    return report.n_diagonal, report.n_far, report.dropped.get(UNEXPLAINED, 0), report.n_moves


def only(recorded, grid=GRID):
    """(state, action, next state) of the one decision, and the report."""
    decisions, report = decisions_from_drive(recorded, grid, PERIOD_S)
    assert len(decisions) == 1
    row = decisions.state[0], decisions.action[0], decisions.next_state[0]
    return tuple(int(each) for each in row), report


@pytest.mark.parametrize(
    ("start_m", "end_m", "next_m", "diagonal", "far"),
    [
        ((0.5, 0.5), (0.5, 0.5), (0.5, 0.5), 0, 0),
        ((0.5, 0.5), (0.9, 0.1), (0.5, 0.5), 0, 0),
        ((0.5, 0.5), (1.5, 0.5), (1.5, 0.5), 0, 0),
        ((0.5, 0.5), (0.5, 1.5), (0.5, 1.5), 0, 0),
        ((0.5, 0.5), (1.9, 1.4), (1.5, 0.5), 1, 0),  # farther east than north
        ((0.5, 0.5), (1.2, 1.9), (0.5, 1.5), 1, 0),  # farther north than east
        ((1.5, 1.5), (2.8, 2.1), (1.5, 2.5), 1, 0),  # farther east, but that cell is a wall
        ((0.5, 0.5), (2.6, 0.5), (1.5, 0.5), 0, 1),
        ((0.5, 0.5), (3.5, 2.5), (1.5, 0.5), 0, 1),
        ((3.5, 2.5), (0.9, 2.2), (2.5, 2.5), 0, 1),
    ],
)
def test_the_next_state_is_the_cell_a_period_later_or_the_neighbour_of_the_larger_displacement(
    start_m, end_m, next_m, diagonal, far
):
    recorded = drive([start_m, start_m, end_m, (3.5, 2.5)], [(0.0, Action.NORTH)])
    row, report = only(recorded)
    assert row == (GRID.state_at(*start_m), Action.NORTH, GRID.state_at(*next_m))
    assert faults(report) == (diagonal, far, 0, 1)
    assert (report.fault_share, report.dropped) == (diagonal + far, {})


def test_the_decision_that_arrives_ends_at_the_arrival_and_nothing_follows():
    places = [(0.5, 0.5), (1.0, 0.5), (1.5, 0.5), (2.5, 0.5), (3.5, 0.5)]
    intents = [(0.0, 2), (2.0, 2), (4.0, 2)]
    decisions, report = decisions_from_drive(drive(places, intents, end_s=3.0), GRID, PERIOD_S)
    assert decisions.time_s.tolist() == [0.0, 2.0]
    assert decisions.next_state.tolist() == [1, 2]
    assert set(decisions.episode) == {3}
    assert report.dropped == {discretise.OUTSIDE_EPISODE: 1}


@pytest.mark.parametrize("outcome", ["timeout", "aborted", "cut_off"])
def test_a_decision_cut_short_without_arrival_is_dropped(outcome):
    places = [(0.5, 0.5), (1.0, 0.5), (1.5, 0.5), (2.5, 0.5)]
    recorded = drive(places, [(0.0, 2), (2.0, 2)], outcome=outcome)
    decisions, report = decisions_from_drive(recorded, GRID, PERIOD_S)
    assert decisions.time_s.tolist() == [0.0]
    assert report.dropped == {discretise.CUT_SHORT: 1}


def test_of_intents_within_a_period_the_first_counts():
    places = [(0.5, 0.5)] * 5
    intents = [(0.0, 1), (0.5, 2), (1.9, 2), (2.0, 3), (3.0, 1)]
    decisions, report = decisions_from_drive(drive(places, intents), GRID, PERIOD_S)
    assert decisions.action.tolist() == [1, 3]
    assert report.dropped == {discretise.WITHIN_PERIOD: 3}


@pytest.mark.parametrize(
    ("outcome", "reason"),
    [("discarded", discretise.IN_DISCARDED), ("return", discretise.ON_WAY_BACK)],
)
def test_a_discarded_episode_and_a_way_back_give_nothing(outcome, reason):
    recorded = drive([(0.5, 0.5)] * 5, [(0.0, 1), (2.0, 1)], outcome=outcome)
    decisions, report = decisions_from_drive(recorded, GRID, PERIOD_S)
    assert len(decisions) == 0
    assert report.dropped == {reason: 2}


def test_walls_outside_and_gaps_are_dropped_with_their_reason():
    off = drive([(2.5, 1.5), (2.5, 1.5), (2.5, 2.5)], [(0.0, 1)])
    assert decisions_from_drive(off, GRID, PERIOD_S)[1].dropped == {discretise.OFF_GRID: 1}
    left = drive([(0.5, 0.5), (0.5, 0.5), (-0.5, 0.5)], [(0.0, 1)])
    assert decisions_from_drive(left, GRID, PERIOD_S)[1].dropped == {discretise.OFF_GRID: 1}
    whole = drive([(0.5, 0.5)] * 4, [(0.1, 1)])
    kept = (whole.pose_time_s < 2.0) | (whole.pose_time_s > 2.6)
    gap = dataclasses.replace(
        whole, pose_time_s=whole.pose_time_s[kept], position_m=whole.position_m[kept]
    )
    assert decisions_from_drive(gap, GRID, PERIOD_S)[1].dropped == {discretise.NO_POSE: 1}


def test_a_drive_without_poses_or_episodes_gives_nothing():
    empty = RecordedDrive(np.zeros(0), np.zeros((0, 2)), np.array([1.0]), np.array([1]), ())
    decisions, report = decisions_from_drive(empty, GRID, PERIOD_S)
    assert len(decisions) == 0
    assert report.dropped == {discretise.OUTSIDE_EPISODE: 1}


@settings(max_examples=150, deadline=None)
@given(
    places=st.lists(st.tuples(st.floats(-0.4, 4.4), st.floats(-0.4, 3.4)), min_size=2, max_size=9),
    intents=st.lists(st.tuples(st.floats(-1, 10), st.integers(0, 4)), max_size=12, unique=True),
    outcome=st.sampled_from(["arrived", "timeout", "discarded"]),
)
def test_every_intent_is_counted_and_every_decision_fits_the_mdp(places, intents, outcome):
    recorded = drive(places, sorted(intents), outcome=outcome)
    decisions, report = decisions_from_drive(recorded, GRID, PERIOD_S)
    assert report.n_intents == len(intents)
    assert report.n_decisions == len(decisions)
    for state, following in zip(decisions.state, decisions.next_state, strict=True):
        assert following == state or following in GRID.neighbours[state]
    assert np.all(np.diff(decisions.time_s) >= PERIOD_S - 1e-5)
    assert report.n_diagonal + report.n_far <= report.n_decisions


@pytest.fixture
def recorded_bag(tmp_path, messages):
    """A bag of a straight drive east over four cells with intents, ended by arrival."""
    writer = BagWriter(tmp_path / "drive")
    for name, kind in OWN_TOPICS.items():
        writer.add_topic(name, kind)
    writer.write("/episode", messages.mark(100.0, "start", 5), 1)
    for tick in range(61):
        time_s = 100.0 + 0.1 * tick
        writer.write("/robot_pose", messages.pose(time_s, 0.5 + 0.05 * tick, 0.5), 2 + tick)
        if tick % 20 == 0:
            writer.write("/intent", messages.intent(time_s, 1.0, 0.0), 2 + tick)
    writer.write("/episode", messages.mark(106.0, "end", 5, "arrived"), 99)
    return writer


def test_a_bag_becomes_decisions_by_its_header_stamps(recorded_bag):
    recorded_bag.close()
    found, report = demonstrations_of_bag(recorded_bag.directory, GRID, PERIOD_S)
    decisions = found.decisions
    assert decisions.time_s.tolist() == [100.0, 102.0, 104.0]
    assert decisions.state.tolist() == [0, 1, 2]
    assert decisions.next_state.tolist() == [1, 2, 3]
    assert decisions.source == f"bag {recorded_bag.directory}"
    assert str(report) == (
        "3 decisions in 1 episodes; assigned to a neighbour: 0 diagonal and 0 far moves;"
        " dropped: 1 outside any episode"
    )


def test_a_missing_topic_and_a_bag_without_decisions_get_a_sentence(tmp_path, small_bag):
    with pytest.raises(BagError, match="must hold the topic 'episode', it holds /intent, /robot_p"):
        demonstrations_of_bag(small_bag(), GRID, PERIOD_S)
    empty = write_bag(tmp_path / "empty", OWN_TOPICS, ())
    with pytest.raises(BagError, match="holds no decision to learn from: 0 decisions"):
        demonstrations_of_bag(empty, GRID, PERIOD_S)


def test_a_message_that_is_cut_short_is_named_with_its_bag_topic_and_time(recorded_bag):
    recorded_bag.write("/robot_pose", b"\x00\x01\x00\x00abc", 1234)
    recorded_bag.close()
    with pytest.raises(BagError, match=r"bag .*drive, /robot_pose at 1234 ns: message must have"):
        read_drives(recorded_bag.directory)


@pytest.mark.parametrize("content", [b"", b"hello", bytes(200)])
def test_of_a_file_that_is_no_bag_the_damage_is_told_and_not_a_missing_topic(tmp_path, content):
    path = tmp_path / "broken.mcap"
    path.write_bytes(content)
    with pytest.raises(BagError, match=r"at byte 0: .*; repair it with 'serd bag recover'"):
        read_drives(path)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_poses_and_intents_that_are_not_finite_are_counted_and_left_out(
    recorded_bag, messages, bad
):
    recorded_bag.flush()
    (before,) = read_drives(recorded_bag.directory, tolerant=True)
    sound, _ = decisions_from_drive(before, GRID, PERIOD_S)
    recorded_bag.write("/robot_pose", messages.pose(105.95, bad, 0.0), 100)
    recorded_bag.write("/robot_pose", messages.pose(107.0, 0.5, bad), 101)
    recorded_bag.write("/intent", messages.intent(106.05, bad, 0.0), 102)
    recorded_bag.close()
    found, report = demonstrations_of_bag(recorded_bag.directory, GRID, PERIOD_S)
    decisions = found.decisions
    assert np.array_equal(decisions.next_state, sound.next_state)
    assert (report.n_bad_poses, report.dropped[NOT_FINITE]) == (2, 1)
    assert str(report).endswith("; 2 poses not finite")


def test_a_bag_of_nothing_but_poses_that_are_not_finite_is_refused():
    session = Session("bag x")
    for time_s in (1.0, 2.0):
        session.poses.extend((time_s, np.nan, 0.0))
    with pytest.raises(BagError, match="bag x must hold poses that are finite, none of its 2 is"):
        session.drive()


def test_faults_of_several_recordings_are_added_and_their_share_has_a_sentence():
    both = joined_reports([report_of(19, 1, 1, 2, {UNEXPLAINED: 1}), report_of(30, 1, 0, 0)])
    assert both.fault_share == 4 / 50
    assert both.faults.startswith("8.0 % of 50 moves are no outcome of the grid (1 diagonal")
    assert report_of(0, 0, 0, 0).fault_share == 0.0
    assert faults(report_of(9, 1, 0, 0, {UNEXPLAINED: 1, OFF_GRID: 5})) == (0, 0, 1, 10)


def test_reports_of_several_drives_are_added_count_by_count():
    one = report_of(9, 1, 2, 3, {OFF_GRID: 5}, 1, 2, 3, 4)
    other = report_of(1, 2, 1, 1, {OFF_GRID: 1, UNEXPLAINED: 7}, 10, 20, 30, 40)
    both = report_of(10, 3, 3, 4, {OFF_GRID: 6, UNEXPLAINED: 7}, 11, 22, 33, 44)
    assert joined_reports([one, other]) == both


def test_nothing_but_the_number_of_decisions_is_counted_of_repeated_episodes():
    """The first episode has a diagonal, an unexplained and a far move, the second one a wait."""
    grid = Grid((0.0, 0.0), 1.0, np.array([[1, 0, 1], [1, 1, 0], [1, 1, 1]], dtype=bool))
    diagonal, unexplained = [(0.5, 1.5), (1.0, 2.0), (1.5, 2.5)], [(2.5, 0.5), (2, 1), (1.5, 1.5)]
    far, wait = [(0.5, 0.5), (0.5, 1.5), (0.5, 2.5)], [(0.5, 1.1), (0.5, 1.5), (0.5, 1.9)]
    intents = [(time_s, Action.WAIT) for time_s in (0.0, 3.0, 6.0, 9.0)]
    spans = (EpisodeSpan(3, 0.0, 8.5, "timeout"), EpisodeSpan(4, 8.5, 11.0, "timeout"))
    recorded = dataclasses.replace(
        drive([*diagonal, *unexplained, *far, *wait], intents),
        minimum_speed_mps=0.1,
        episodes=spans,
    )
    seen = set()
    every, report = decisions_from_drive(recorded, grid, PERIOD_S, seen)
    assert every.episode.tolist() == [3, 3, 4]
    assert report == report_of(3, 2, 1, 1, {UNEXPLAINED: 1}, n_moving_waits=3)
    repeated = report_of(0, 0, 0, 0, {REPEATED: 4})
    assert decisions_from_drive(recorded, grid, PERIOD_S, seen)[1] == repeated
    second = set(discretise.episode_rows(every.select_episodes([4])).values())
    first, of_first = decisions_from_drive(recorded, grid, PERIOD_S, second)
    assert first.episodes.tolist() == [3]
    assert faults(of_first) == (1, 1, 1, 3)
    assert (of_first.dropped, of_first.n_moving_waits) == ({UNEXPLAINED: 1, REPEATED: 1}, 2)


@pytest.mark.parametrize(("moved_m", "n_moving"), [(0.375, 0), (0.5, 1), (0.625, 1)])
def test_a_wait_moves_from_the_least_speed_over_its_period_on(moved_m, n_moving):
    recorded = drive([(2.25, 0.5), (2.25, 0.5), (2.25 + moved_m, 0.5)], [(0.0, Action.WAIT)])
    recorded = dataclasses.replace(recorded, minimum_speed_mps=0.25)
    assert only(recorded)[1].n_moving_waits == n_moving


def test_reasons_that_were_counted_while_reading_stay_counted():
    recorded = drive([(0.5, 0.5)] * 4, [(-1.0, 1), (0.0, 1)])
    recorded = dataclasses.replace(recorded, dropped={discretise.OUTSIDE_EPISODE: 2})
    assert only(recorded)[1].dropped == {discretise.OUTSIDE_EPISODE: 3}


def test_an_intent_at_the_start_of_an_episode_is_in_it_and_one_at_its_end_is_not():
    recorded = drive([(0.5, 0.5)] * 7, [(0.0, 1), (2.0, 1), (4.0, 1)])
    spans = (EpisodeSpan(3, 0.0, 2.0, "arrived"), EpisodeSpan(4, 4.0, 6.0, "arrived"))
    decisions, report = decisions_from_drive(
        dataclasses.replace(recorded, episodes=spans), GRID, PERIOD_S
    )
    assert decisions.episode.tolist() == [3, 4]
    assert report.dropped == {discretise.OUTSIDE_EPISODE: 1}


def test_an_intent_after_an_episode_was_cut_off_is_counted_as_that():
    recorded = drive([(0.5, 0.5)] * 5, [(0.0, 1), (3.0, 1)], end_s=2.0, outcome="cut_off")
    assert only(recorded)[1].dropped == {discretise.AFTER_CUT_OFF: 1}


def test_the_period_must_be_above_0():
    recorded = drive([(0.5, 0.5)] * 4, [(0.0, 1), (1.0, 1)])
    assert len(decisions_from_drive(recorded, GRID, 1.0)[0]) == 2
    with pytest.raises(BagError, match=r"^decision_period_s must be above 0, got 0.0$"):
        decisions_from_drive(recorded, GRID, 0.0)


def test_what_was_left_out_while_reading_is_in_the_report_and_its_sentence():
    counts = {"n_bad_poses": 2, "n_unplaced_poses": 3, "n_bad_commands": 4}
    recorded = dataclasses.replace(drive([(0.5, 0.5)] * 4, [(0.0, 1), (9.0, 1)]), **counts)
    report = only(recorded)[1].model_copy(update={"n_moving_waits": 5})
    assert {name: getattr(report, name) for name in counts} == counts
    assert str(report.model_copy(update={"dropped": {"a": 1, "b": 2}})) == (
        "1 decisions in 1 episodes; assigned to a neighbour: 0 diagonal and 0 far moves;"
        " dropped: 1 a, 2 b; 2 poses not finite; 3 poses without /tf; 4 commands not finite;"
        " 5 waits while moving"
    )


def test_each_move_to_a_neighbour_is_counted_also_into_the_first_cell():
    beside = [(1.5, 0.5), (0.8, 0.8), (0.1, 1.1), (1.5, 0.5), (1.5, 0.5), (0.8, 0.8), (0.1, 1.1)]
    recorded = drive(beside, [(0.0, Action.WEST), (4.0, Action.WEST)])
    decisions, report = decisions_from_drive(recorded, GRID, PERIOD_S)
    assert decisions.next_state.tolist() == [0, 0]
    assert (report.n_diagonal, report.dropped) == (2, {})


def test_places_are_known_between_poses_up_to_the_longest_gap_and_not_after_the_last():
    """Poses come every 0.25 s until 3 s."""
    recorded = drive([(0.5, 0.5)] * 4, [(0.1, 1), (2.2, 1)], end_s=5.0)
    for longest_gap_s, reasons in ((0.25, 1), (0.2, 2)):
        with_gaps = dataclasses.replace(recorded, longest_gap_s=longest_gap_s)
        report = decisions_from_drive(with_gaps, GRID, PERIOD_S)[1]
        assert report.dropped == {discretise.NO_POSE: reasons}
