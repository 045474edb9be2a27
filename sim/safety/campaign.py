"""Fault campaign: episodes in which inputs fail at full speed, with and without the guard.

Each control period runs in the order of the live stack: the world publishes, the fault decides what
arrives, the planner plans on the newest inputs, the guard passes the command on. Both see the same
messages. A row tells how soon and after what distance the robot stood, and what it touched.
"""

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path

import numpy as np

from serd_core.grid.grid import Action, Grid
from sim.drivers.catalogue import Driver, make_driver
from sim.episodes.batch import Progress, run_missing, scenario_of
from sim.episodes.execution import Execution
from sim.episodes.progress import EpisodeProgress
from sim.perception.scan_matcher import ScanMatcher
from sim.planning.catalogue import make_planner
from sim.robot.contacts import ContactCounts
from sim.safety.faults import (
    Message,
    Messages,
    OdometryMessage,
    PeopleMessage,
    fault_named,
)
from sim.safety.guard import Guard, GuardOutput
from sim.safety.reasons import Fault, GuardAction, Source
from sim.safety.scan import Scan
from sim.safety.settings import GuardSettings
from sim.safety.world_guard import scan_geometry_of
from sim.scenario.grid import grid_of
from sim.scenario.scenario import Scenario
from sim.world.command import STOP, Command
from sim.world.directive import FollowedDirective
from sim.world.observation import Observation, make_observation
from sim.world.seeds import FAULT, episode_rng
from sim.world.waypoint import Waypoint, is_decision_tick, waypoint_of_cell, waypoint_of_intent
from sim.world.world import HallwayWorld
from storage.row_table import Key, Row, RowTable
from storage.table import OptionalFloat, cell_text, columns_of

#: A fault begins when the robot drives at this share of its largest speed, after this time (s).
_FULL_SPEED = 0.9
_EARLIEST_S = 1.0
#: The robot stands below this speed.
_STANDING_MPS = 0.02
#: How long an episode goes on after a fault has begun.
WATCHED_S = 9.0
#: The planner stops when no observation has arrived for this time, as the node does.
_SILENT_S = 0.5
#: Waypoints lie this many cells ahead of the decision.
_LOOKAHEAD_CELLS = 2


@dataclass(frozen=True)
class FaultTask:
    """What defines one episode. n_people: the scenario's own number when None."""

    fault: str
    guarded: int
    scenario: str = "hallway"
    seed: int = 1
    n_people: int | None = 60
    planner: str = "dwa"
    driver: str = "expert_with_flow"

    @property
    def key(self) -> Key:
        """The task as the texts of its cells."""
        return tuple(cell_text(getattr(self, each.name)) for each in fields(self))


@dataclass(frozen=True)
class FaultOutcome:
    """What came of one episode; times and distances from the beginning of the fault.

    began: 0 where the robot never reached full speed, so that there was no fault. zero_s: until the
    command was zero. stood_s, stood_m: until the robot stood; NaN where it did not. later_m: way
    after that; way_m: the whole way. duration_s: of the episode. Contacts: since the beginning.
    n_input_stops: stops of the guard for an input, n_collision_stops: for an obstacle.
    """

    began: int
    speed_mps: float
    zero_s: OptionalFloat
    stood_s: OptionalFloat
    stood_m: OptionalFloat
    later_m: float
    way_m: float
    duration_s: float
    time_of_arrival_s: OptionalFloat
    robot_on_person: int
    person_on_robot: int
    robot_on_wall: int
    n_input_stops: int
    n_collision_stops: int


TASK_COLUMNS = tuple(each.name for each in fields(FaultTask))
COLUMNS = (*columns_of(FaultTask), *columns_of(FaultOutcome))


def tasks_of(
    faults: Iterable[str], seeds: Iterable[int], **condition: str | int | None
) -> list[FaultTask]:
    """Every fault with and without the guard, on every seed."""
    return [
        FaultTask(fault, guarded, seed=seed, **condition)  # type: ignore[arg-type]
        for fault in faults
        for guarded in (0, 1)
        for seed in seeds
    ]


def run_campaign(
    tasks: Sequence[FaultTask],
    path: str | Path,
    execution: Execution,
    on_progress: Progress | None = None,
) -> list[Row]:
    """Rows of all tasks, from the file where they are there already, else run and added to it."""
    for task in {replace(task, seed=0) for task in tasks}:
        fault_named(task.fault)
        scenario = scenario_of(task.scenario, task.n_people)
        make_planner(task.planner, scenario)
        make_driver(task.driver, scenario, 0)
    with RowTable(path, COLUMNS, TASK_COLUMNS) as table:
        return run_missing(run_fault, tasks, table, execution, on_progress)


def run_fault(task: FaultTask) -> Row:
    """Run one episode; its row."""
    scenario = scenario_of(task.scenario, task.n_people)
    with HallwayWorld(scenario, seed=task.seed) as world:
        outcome = _FaultyEpisode(world, task).run()
    return {**asdict(task), **asdict(outcome)}


class _LivePlanner:
    """The local planner of the live stack: it plans on the newest complete observation."""

    def __init__(self, scenario: Scenario, planner: str, people_from: str) -> None:
        self._scans = ScanMatcher(scenario) if people_from == "scan" else None
        made = make_planner(planner, scenario)
        self._planner = self._scans.planner_on(made) if self._scans else made
        self._period_s = scenario.control_period_s
        self._grid = grid_of(scenario)
        self._followed = FollowedDirective(scenario)
        self._parts: dict[Source, Message] = {}
        self._arrived_s = -math.inf
        self.observation: Observation | None = None

    def receive(self, messages: Messages, now_s: float) -> None:
        for each in messages:
            if each.source is not Source.SCAN:
                self._parts[each.source] = each
            elif self._scans is not None:
                self._scans.take_scan(round(each.stamp_s * 1e9), each.value.ranges_m)
        observation = self._synchronised()
        if observation is not None and (
            self.observation is None or observation.tick != self.observation.tick
        ):
            self.observation, self._arrived_s = observation, now_s
            if self._scans is not None:
                self._scans.take_observation(observation)

    def _synchronised(self) -> Observation | None:
        needed = [Source.POSE, Source.ODOMETRY]
        if self._scans is None:
            needed.append(Source.PEOPLE)
        if any(source not in self._parts for source in needed):
            return None
        if len({self._parts[source].stamp_s for source in needed}) > 1:
            return None
        pose, odometry = self._parts[Source.POSE], self._parts[Source.ODOMETRY].value
        people = self._parts[Source.PEOPLE].value if self._scans is None else _NOBODY
        return make_observation(
            time_s=pose.stamp_s,
            tick=round(pose.stamp_s / self._period_s),
            pose=pose.value,
            speed_mps=odometry.speeds[0],
            yaw_rate_radps=odometry.speeds[1],
            people_position_m=people.position_m,
            people_velocity_mps=people.velocity_mps,
            people_id=people.identity,
        )

    def decide(self, driver: Driver) -> None:
        """Take the waypoint of the decision period that begins now."""
        observation = self.observation
        if observation is not None:
            waypoint = _waypoint_ahead(self._grid, observation, driver.decide(observation))
            self._followed.take(observation.time_s, waypoint)

    def command(self, now_s: float) -> Command:
        if self.observation is None or now_s - self._arrived_s > _SILENT_S:
            return STOP
        return self._planner.step(self.observation, self._followed.waypoint(self.observation))


def _waypoint_ahead(grid: Grid, observation: Observation, action: Action) -> Waypoint:
    """The waypoint of some cells on in the direction of an action, so that the robot is fast."""
    here = grid.state_at(observation.x_m, observation.y_m)
    if action == Action.WAIT or here < 0:
        return waypoint_of_intent(grid, observation, action)
    for _ in range(_LOOKAHEAD_CELLS):
        here = int(grid.neighbours[here, action])
    return waypoint_of_cell(grid, here)


_NOBODY = PeopleMessage(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0, dtype=np.int64))


class _Watch:
    """Measures from the beginning of a fault on."""

    def __init__(self) -> None:
        self.start: Observation | None = None
        self.zero_s = self.stood_s = self.stood_m = math.nan
        self.way_m = 0.0
        self._contacts = ContactCounts()

    def begin(self, observation: Observation, contacts: ContactCounts) -> None:
        self.start, self._contacts = observation, contacts

    def elapsed_s(self, observation: Observation) -> float:
        """Time since the beginning, -inf before it."""
        return -math.inf if self.start is None else observation.time_s - self.start.time_s

    def see(self, before: Observation, command: Command, after: Observation) -> None:
        if self.start is None:
            return
        self.way_m += math.hypot(after.x_m - before.x_m, after.y_m - before.y_m)
        if math.isnan(self.zero_s) and command == STOP:
            self.zero_s = self.elapsed_s(before)
        stands = abs(after.speed_mps) < _STANDING_MPS
        if math.isnan(self.stood_s) and stands and not math.isnan(self.zero_s):
            self.stood_s, self.stood_m = self.elapsed_s(after), self.way_m

    def contacts_since(self, now: ContactCounts) -> ContactCounts:
        then = asdict(self._contacts)
        return ContactCounts(**{name: n - then[name] for name, n in asdict(now).items()})


class _FaultyEpisode:
    def __init__(self, world: HallwayWorld, task: FaultTask) -> None:
        scenario = world.scenario
        self._world, self._kind = world, fault_named(task.fault)
        self._driver = make_driver(task.driver, scenario, task.seed)
        self._planner = _LivePlanner(scenario, task.planner, self._kind.people_from)
        settings = GuardSettings.of_scenario(scenario, self._kind.people_from)
        self._guard = Guard(settings) if task.guarded else None
        rng = episode_rng(task.seed, 0, FAULT)
        self._channel = self._kind.make(rng, scenario.control_period_s)
        self._geometry = scan_geometry_of(scenario.lidar)
        self._watch = _Watch()
        self._stopped_for: bool | None = None
        self._n_stops: Counter[bool] = Counter()

    def run(self) -> FaultOutcome:
        world, watch, kind = self._world, self._watch, self._kind
        observation = world.reset(0)
        self._driver.begin(0)
        progress = EpisodeProgress(world.scenario, observation, world.scenario.episode_timeout_s)
        if kind.lasts:
            watch.begin(observation, world.contacts)
        ending = None
        while ending is None and (kind.lasts or watch.elapsed_s(observation) < WATCHED_S):
            if watch.start is None and self._at_full_speed(observation, progress):
                watch.begin(observation, world.contacts)
            command = self._command(observation)
            before, observation = observation, world.step(command)
            watch.see(before, command, observation)
            ending = progress.see(observation)
        start = watch.start
        return FaultOutcome(
            began=int(start is not None),
            speed_mps=0.0 if start is None else start.speed_mps,
            zero_s=watch.zero_s,
            stood_s=watch.stood_s,
            stood_m=watch.stood_m,
            later_m=0.0 if math.isnan(watch.stood_m) else watch.way_m - watch.stood_m,
            way_m=watch.way_m,
            duration_s=progress.duration_s,
            time_of_arrival_s=progress.duration_s if ending == "arrived" else math.nan,
            **asdict(watch.contacts_since(world.contacts)),
            n_input_stops=self._n_stops[True],
            n_collision_stops=self._n_stops[False],
        )

    def _at_full_speed(self, observation: Observation, progress: EpisodeProgress) -> bool:
        fastest_mps = self._world.scenario.robot.max_vel_x_mps
        fast = observation.speed_mps >= _FULL_SPEED * fastest_mps
        return fast and progress.duration_s >= _EARLIEST_S

    def _command(self, observation: Observation) -> Command:
        """What reaches the robot at this observation."""
        now_s, planner = observation.time_s, self._planner
        messages = self._published(observation)
        if self._watch.start is not None:
            messages = self._channel(messages)
        planner.receive(messages, now_s)
        silent = self._kind.ends_waypoints and self._watch.start is not None
        if is_decision_tick(observation, self._world.scenario) and not silent:
            planner.decide(self._driver)
        command = planner.command(now_s)
        return command if self._guard is None else self._guarded(messages, command, now_s)

    def _published(self, observation: Observation) -> Messages:
        world, time_s = self._world, observation.time_s
        speeds = observation.speed_mps, observation.yaw_rate_radps
        people = PeopleMessage(
            observation.people_position_m, observation.people_velocity_mps, observation.people_id
        )
        messages = [
            Message(Source.ODOMETRY, time_s, OdometryMessage(world.odometry_pose, speeds)),
            Message(Source.POSE, time_s, observation.pose),
            Message(Source.PEOPLE, time_s, people),
        ]
        if world.is_scan_tick:
            scan = Scan(time_s, world.scan(observation), self._geometry)
            messages.append(Message(Source.SCAN, time_s, scan))
        return messages

    def _guarded(self, messages: Messages, command: Command, now_s: float) -> Command:
        guard = self._guard
        assert guard is not None
        guard.advance(now_s)
        for each in messages:
            if each.source is Source.ODOMETRY:
                guard.receive_odometry(each.stamp_s, each.value.pose, each.value.speeds)
            elif each.source is Source.POSE:
                guard.receive_pose(each.stamp_s, each.value)
            elif each.source is Source.PEOPLE:
                people = each.value
                guard.receive_people(each.stamp_s, people.position_m, people.velocity_mps)
            else:
                guard.receive_scan(each.value)
        guard.receive_command(now_s, command)
        output = guard.step(now_s)
        self._count(output)
        return output.command

    def _count(self, output: GuardOutput) -> None:
        """Count stops when they begin, by whether an input or an obstacle is the reason."""
        stops = output.action is GuardAction.STOP
        cause = output.reasons[0].fault is not Fault.COLLISION if stops else None
        if cause is not None and cause != self._stopped_for:
            self._n_stops[cause] += 1
        self._stopped_for = cause
