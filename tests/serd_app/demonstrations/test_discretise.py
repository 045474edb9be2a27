"""Decisions from drives: hand-made cases, and laws that hold for every drive."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from serd_app.demonstrations import discretise
from serd_app.demonstrations.discretise import (
    LOST,
    NO_COMMAND,
    OFF_GRID,
    REPEATED,
    DiscretisationReport,
    decisions_from_drive,
    demonstrations_of_bag,
)
from serd_app.drives.actions import intents_of_velocities
from serd_app.drives.drive import NOT_FINITE, SILENCE, EpisodeSpan, RecordedDrive
from serd_app.drives.sessions import read_drives
from serd_bag.errors import BagError
from serd_bag.writer import BagWriter
from serd_core.demonstrations.decisions import HIDDEN
from serd_core.grid.grid import Action, Grid
from serd_sim.episodes.episode import run_episode
from serd_sim.planning.local_planner import make_planner
from serd_sim.scenario.scenario import load_scenario
from serd_sim.world.world import HallwayWorld
from support.bag_messages import OWN_TOPICS, write_bag

PATIENCE_S, WAIT_S = 4.0, 1.0
GRID = Grid((0.0, 0.0), 1.0, np.array([[1, 1, 1, 1], [1, 1, 0, 1], [1, 1, 1, 1]], dtype=bool))
EAST, NORTH, WEST, WAIT = (int(each) for each in (Action.EAST, Action.NORTH, Action.WEST, 0))


def drive(places, intents, end_s=None, outcome="arrived", step_s=0.05, **values):
    """A drive through `places` (x, y), one per second, with intents (time, action)."""
    time_s = np.arange(len(places), dtype=float)
    fine_s = np.linspace(0.0, time_s[-1], round(time_s[-1] / step_s) + 1)
    x, y = np.array(places, dtype=float).T
    return RecordedDrive(
        pose_time_s=fine_s,
        position_m=np.stack([np.interp(fine_s, time_s, x), np.interp(fine_s, time_s, y)], axis=1),
        intent_time_s=np.array([time for time, _ in intents], dtype=float),
        intent_action=np.array([int(action) for _, action in intents], dtype=np.int64),
        episodes=(EpisodeSpan(3, 0.0, time_s[-1] if end_s is None else end_s, outcome),),
        source="hand",
        **values,
    )


def east(n_seconds, intents, **values):
    """One metre each second from the centre of the cell in the lower left."""
    return drive([(0.5 + second, 0.5) for second in range(n_seconds + 1)], intents, **values)


def still(n_seconds, intents, **values):
    return drive([(0.5, 0.5)] * (n_seconds + 1), intents, **values)


def with_gap(recorded, from_s, until_s):
    kept = (recorded.pose_time_s <= from_s) | (recorded.pose_time_s >= until_s)
    values = {name: getattr(recorded, name)[kept] for name in ("pose_time_s", "position_m")}
    return dataclasses.replace(recorded, **values)


def found(recorded, grid=GRID, **options):
    return decisions_from_drive(recorded, grid, PATIENCE_S, WAIT_S, **options)


def rows(decisions):
    """(time, state, action, next state, dwell time, censored) of each."""
    columns = (decisions.time_s.round(6), decisions.state, decisions.action, decisions.next_state)
    more = decisions.dwell_s.round(6), decisions.censored
    return list(zip(*(each.tolist() for each in (*columns, *more)), strict=True))


SAVED = {"outcome": "saved"}
#: Blocked on its way east, the driver turns north: east did not lead north.
BLOCKED = [(0.5, 0.5), (0.8, 0.5), (0.8, 0.5), (0.8, 1.5), (0.8, 1.5)]
STANDS_THEN_MOVES = [*[(0.5, 0.5)] * 4, *[(1.3, 0.5)] * 9]
SILENT = {"intent_hold_s": np.inf}
ABOVE, CORNER, EDGE, TOP = (
    int(GRID.state_at(*at)) for at in ((0.5, 1.5), (1.5, 1.5), (3.5, 1.5), (2.5, 2.5))
)


@pytest.mark.parametrize(
    ("recorded", "dropped", "expected"),
    [
        # A cell is entered a tenth of it beyond its border.
        (east(3, [(0, EAST)], **SAVED), {},
         [(0.0, 0, EAST, 1, 0.6, False), (0.6, 1, EAST, 2, 1.0, False),
          (1.6, 2, EAST, 3, 1.0, False), (2.6, 3, EAST, 3, 0.4, True)]),
        (east(2, [(0, HIDDEN)], **SAVED, **SILENT), {},
         [(0.0, 0, HIDDEN, 1, 0.6, False), (0.6, 1, HIDDEN, 2, 1.0, False),
          (1.6, 2, HIDDEN, 2, 0.4, True)]),
        # What leads nowhere ends after the patience, a wait earlier.
        (still(10, [(0, EAST), (4, EAST), (8, WAIT)], outcome="timeout"), {},
         [(0.0, 0, EAST, 0, 4.0, False), (4.0, 0, EAST, 0, 4.0, False),
          (8.0, 0, WAIT, 0, 1.0, False), (9.0, 0, WAIT, 0, 1.0, False)]),
        (drive(BLOCKED, [(0, EAST), (2, NORTH)], **SAVED), {},
         [(0.0, 0, EAST, 0, 2.0, True), (2.0, 0, NORTH, ABOVE, 0.6, False),
          (2.6, ABOVE, NORTH, ABOVE, 1.4, True)]),
        # Another command counts once it has been given for 0.3 s, and from then on.
        (still(3, [(0, EAST), (1, NORTH), (1.2, EAST)], **SAVED), {},
         [(0.0, 0, EAST, 0, 3.0, True)]),
        (still(3, [(0, EAST), (1, NORTH), (1.4, EAST)], **SAVED), {},
         [(0.0, 0, EAST, 0, 1.0, True), (1.0, 0, NORTH, 0, 0.4, True),
          (1.4, 0, EAST, 0, 1.6, True)]),
        (east(2, [(0, EAST), (0.5, NORTH)], **SAVED), {},
         [(0.0, 0, EAST, 1, 0.6, False), (0.6, 1, NORTH, 2, 1.0, False),
          (1.6, 2, NORTH, 2, 0.4, True)]),
        # An arrival less far in the cell than a border needs is an outcome, another end is none.
        (drive([(0.5, 0.5), (1.05, 0.5)], [(0, EAST)]), {}, [(0.0, 0, EAST, 1, 1.0, False)]),
        (drive([(0.5, 0.5), (1.05, 0.5)], [(0, EAST)], outcome="timeout"), {},
         [(0.0, 0, EAST, 0, 1.0, True)]),
        # An intent is in force for the patience, or until silence is stated.
        (drive(STANDS_THEN_MOVES, [(1, EAST), (9, WAIT)], **SAVED), {NO_COMMAND: 2},
         [(1.0, 0, EAST, 1, 2.75, False), (3.75, 1, EAST, 1, 1.25, True),
          *((time_s, 1, WAIT, 1, 1.0, False) for time_s in (9.0, 10.0, 11.0))]),
        (still(3, [(0, EAST), (1, SILENCE), (2, EAST)], **SILENT), {NO_COMMAND: 1},
         [(0.0, 0, EAST, 0, 1.0, True), (2.0, 0, EAST, 0, 1.0, True)]),
        # A gap of poses loses the decision; a leap through a wall is no outcome.
        (with_gap(east(3, [(0, EAST)], **SAVED), 0.9, 2.1), {LOST: 1},
         [(0.0, 0, EAST, 1, 0.6, False), (2.1, 2, EAST, 3, 0.5, False),
          (2.6, 3, EAST, 3, 0.4, True)]),
        (with_gap(east(3, [(0, EAST)], **SAVED), 2.3, 9.0), {LOST: 1},
         [(0.0, 0, EAST, 1, 0.6, False), (0.6, 1, EAST, 2, 1.0, False)]),
        (with_gap(drive([(1.5, 1.5), (1.5, 1.5), (3.5, 1.5)], [(0, NORTH)], **SAVED), 1.05, 1.45),
         {LOST: 1}, [(1.75, EDGE, NORTH, EDGE, 0.25, True)]),
        # Off the grid; across a wall from a cell beyond it on.
        (drive([(2.5, 1.5), (2.5, 1.5), (2.5, 2.5)], [(0, NORTH)], **SAVED), {OFF_GRID: 1},
         [(1.5, TOP, NORTH, TOP, 0.5, True)]),
        (drive([(0.5, 0.5), (0.5, 0.5), (-1.5, 0.5)], [(0, WEST)], **SAVED), {OFF_GRID: 2}, []),
        # Discarded episodes and ways back.
        (still(4, [(0, 1), (2, 1)], outcome="discarded"), {discretise.IN_DISCARDED: 2}, []),
        (still(4, [(0, 1), (2, 1)], outcome="return"), {discretise.ON_WAY_BACK: 2}, []),
        # Outside of an episode, beside those counted while reading, and after one was cut off.
        (still(3, [(-1, 1), (0, 1)], dropped={discretise.OUTSIDE_EPISODE: 2}),
         {discretise.OUTSIDE_EPISODE: 3}, [(0.0, 0, 1, 0, 3.0, True)]),
        (still(4, [(0, 1), (3, 1)], end_s=2.0, outcome="cut_off"), {discretise.AFTER_CUT_OFF: 1},
         [(0.0, 0, 1, 0, 2.0, True)]),
    ],
)  # fmt: skip
def test_a_drive_gives_the_decisions_that_its_places_and_commands_state(
    recorded, dropped, expected
):
    decisions, report = found(recorded)
    assert rows(decisions) == expected
    assert report == DiscretisationReport(
        n_decisions=len(expected),
        n_censored=sum(row[-1] for row in expected),
        n_episodes=len({*decisions.episode} & {3}),
        dropped=dropped,
        n_moving_waits=report.n_moving_waits,
    )


@settings(max_examples=150, deadline=None)
@given(
    places=st.lists(st.tuples(st.floats(-0.4, 4.4), st.floats(-0.4, 3.4)), min_size=2, max_size=9),
    intents=st.lists(st.tuples(st.floats(-1, 10), st.integers(-2, 4)), max_size=12, unique=True),
    outcome=st.sampled_from(["arrived", "timeout", "discarded"]),
    step_s=st.sampled_from([0.05, 0.25]),
)
def test_every_decision_fits_the_mdp_and_none_overlaps_the_next(places, intents, outcome, step_s):
    recorded = drive(places, sorted(intents), outcome=outcome, step_s=step_s)
    decisions, report = found(recorded)
    assert report.n_decisions == len(decisions)
    assert report.n_censored == decisions.censored.sum()
    for state, following in zip(decisions.state, decisions.next_state, strict=True):
        assert following == state or following in GRID.neighbours[state]
    ends_s = decisions.time_s + decisions.dwell_s
    assert np.all(ends_s[:-1] <= decisions.time_s[1:] + 0.021)
    assert np.all(np.diff(decisions.time_s) > 0)
    assert np.all(decisions.dwell_s <= PATIENCE_S + 0.25)
    assert SILENCE not in decisions.action


def test_a_recorded_episode_gives_the_decisions_that_its_driver_took():
    """Of 0.05 s between poses, through the people of the hallway."""
    scenario = load_scenario("hallway")
    intents, poses = [], []

    class Chance:
        name = "chance"

        def begin(self, episode):
            self.rng = np.random.default_rng(episode)

        def decide(self, observation, _):
            action = Action(int(self.rng.choice(5, p=[0.1, 0.6, 0.1, 0.1, 0.1])))
            intents.append((observation.time_s, int(action)))
            return action

    class SeenWorld(HallwayWorld):
        def reset(self, *arguments):
            poses.append(super().reset(*arguments))
            return poses[-1]

        def step(self, command):
            poses.append(super().step(command))
            return poses[-1]

    world, planner = SeenWorld(scenario, seed=3), make_planner(scenario)
    record = run_episode(world, planner, Chance(), episode=0, timeout_s=25.0)
    track = np.array([(pose.time_s, pose.x_m, pose.y_m) for pose in poses])
    intent_time_s, action = np.array(intents).T
    span = EpisodeSpan(0, track[0, 0], track[-1, 0], record.outcome)
    recorded = RecordedDrive(
        track[:, 0], track[:, 1:], intent_time_s, action.astype(np.int64), (span,)
    )
    times_s = scenario.patience_s, scenario.wait_s
    decisions, report = decisions_from_drive(recorded, world.grid, *times_s)
    assert len(decisions) > 15
    for name, column in record.decisions.columns().items():
        np.testing.assert_array_equal(getattr(decisions, name), column, err_msg=name)
    assert report.dropped == {}


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
    decisions, report = demonstrations_of_bag(recorded_bag.directory, GRID, PATIENCE_S, WAIT_S)
    np.testing.assert_allclose(decisions.time_s, [100.0, 101.2, 103.2, 105.2], atol=1e-6)
    assert decisions.state.tolist() == [0, 1, 2, 3]
    assert decisions.next_state.tolist() == [1, 2, 3, 3]
    assert decisions.source == f"bag {recorded_bag.directory}"
    assert str(report) == (
        "4 decisions in 1 episodes, 1 of them without outcome; dropped: 1 outside any episode"
    )


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_poses_and_intents_that_are_not_finite_are_counted_and_left_out(
    recorded_bag, messages, bad
):
    recorded_bag.flush()
    (before,) = read_drives(recorded_bag.directory, tolerant=True)
    sound, _ = found(before)
    recorded_bag.write("/robot_pose", messages.pose(105.95, bad, 0.0), 100)
    recorded_bag.write("/robot_pose", messages.pose(107.0, 0.5, bad), 101)
    recorded_bag.write("/intent", messages.intent(106.05, bad, 0.0), 102)
    recorded_bag.close()
    gathered, report = demonstrations_of_bag(recorded_bag.directory, GRID, PATIENCE_S, WAIT_S)
    assert rows(gathered) == rows(sound)
    assert (report.n_bad_poses, report.dropped[NOT_FINITE]) == (2, 1)
    assert str(report).endswith("; 2 poses not finite")


def test_a_bag_that_gives_no_decision_is_named_with_the_reason(
    tmp_path, messages, small_bag, recorded_bag
):
    def refused(bag, sentence):
        with pytest.raises(BagError, match=sentence):
            demonstrations_of_bag(bag, GRID, PATIENCE_S, WAIT_S)

    refused(small_bag(), "must hold the topic 'episode', it holds /intent, /robot_p")
    empty = write_bag(tmp_path / "empty", OWN_TOPICS, ())
    refused(empty, "holds no decision to learn from: 0 decisions")
    bad = [("/robot_pose", time_s, messages.pose(time_s, np.nan, 0.0)) for time_s in (1.0, 2.0)]
    unknown = write_bag(tmp_path / "unknown", OWN_TOPICS, bad)
    refused(unknown, "unknown must hold poses that are finite, none of its 2 is")
    recorded_bag.write("/robot_pose", b"\x00\x01\x00\x00abc", 1234)
    recorded_bag.close()
    where = r"bag .*drive, /robot_pose at 1234 ns: message must have"
    refused(recorded_bag.directory, where)
    for content in (b"", b"hello", bytes(200)):
        (tmp_path / "broken.mcap").write_bytes(content)
        refused(
            tmp_path / "broken.mcap", r"at byte 0: .*; save what it holds with 'serd-bag rescue'"
        )


def test_repeated_episodes_are_counted_and_their_waits_are_not():
    recorded = still(8, [(0.0, EAST), (4.0, WAIT)])
    spans = (EpisodeSpan(3, 0.0, 4.0, "timeout"), EpisodeSpan(4, 4.0, 8.0, "timeout"))
    recorded = dataclasses.replace(recorded, episodes=spans)
    seen = set()
    every, report = found(recorded, seen=seen)
    assert (every.episodes.tolist(), report.dropped) == ([3, 4], {})
    again, report = found(recorded, seen=seen)
    assert (len(again), report.dropped) == (0, {REPEATED: len(every)})
    second = set(discretise.episode_rows(every.select_episodes([4])).values())
    assert found(recorded, seen=second)[0].episodes.tolist() == [3]


@pytest.mark.parametrize(("moved_m", "n_moving"), [(0.2, 0), (0.3, 1)])
def test_a_wait_moves_from_the_least_speed_on(moved_m, n_moving):
    recorded = drive([(2.25, 0.5), (2.25 + moved_m, 0.5)], [(0.0, WAIT)], minimum_speed_mps=0.25)
    assert found(recorded)[1].n_moving_waits == n_moving


@pytest.mark.parametrize("degrees", [30.0, 40.0, 50.0, 60.0, 130.0, -35.0])
def test_a_slanted_way_is_for_the_cells_that_it_enters(degrees):
    """Each decision of a drive straight on at an angle leads to the cell that it is for."""
    wide = Grid((-12.0, -12.0), 1.0, np.ones((24, 24), dtype=bool))
    angle, time_s = np.deg2rad(degrees), np.arange(0.0, 20.0, 0.05)
    way_m = np.array([np.cos(angle), np.sin(angle)])
    spans = (EpisodeSpan(0, 0.0, float(time_s[-1]), "unmarked"),)
    intents = intents_of_velocities(
        spans,
        command_time_s=np.array([0.0]),
        command_mps=np.array([[0.5, 0.0]]),
        pose_time_s=time_s,
        yaw_rad=np.full(len(time_s), angle),
        hold_s=np.inf,
    )
    places_m = np.array([0.05, 0.15]) + 0.5 * time_s[:, None] * way_m
    recorded = RecordedDrive(time_s, places_m, episodes=spans, **intents)
    decisions, _ = decisions_from_drive(recorded, wide, 4.0, 1.0)
    seen = decisions.select(decisions.censored == 0)
    assert len(seen) >= 8
    assert len(np.unique(seen.action)) == 2
    aimed_at = wide.neighbours[seen.state, seen.action]
    assert (aimed_at != seen.next_state).sum() <= 1  # a way through a corner
