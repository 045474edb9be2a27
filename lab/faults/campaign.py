"""Fault campaign: episodes in which inputs fail at full speed, with and without the guard.

Each control period runs in the order of the live stack: the world publishes, the fault decides what
arrives, the planner plans on the newest inputs, the guard passes the command on. Both see the same
messages. A row has how soon and after what distance the robot stood, and what it touched.
"""

import math
from collections import Counter
from collections.abc import Iterable
from dataclasses import asdict, dataclass, fields, replace

from lab.faults.faults import Messages, fault_named
from serd_files.table import Column, OptionalFloat, Row, columns_of
from serd_sim.drivers.catalogue import Driver, make_driver
from serd_sim.episodes.batch import INPUTS, EpisodeTask, inputs_digest, scenario_of
from serd_sim.episodes.episode import EpisodeProgress
from serd_sim.perception.scan_people import ScanPerception
from serd_sim.planning.local_planner import make_planner
from serd_sim.robot.robot import ContactCounts
from serd_sim.safety.guard import Guard, GuardOutput
from serd_sim.safety.reasons import Fault, GuardAction, Source
from serd_sim.safety.settings import GuardSettings
from serd_sim.safety.world_guard import Message, guarded, published
from serd_sim.scenario.scenario import Scenario
from serd_sim.world.command import STOP, Command
from serd_sim.world.epochs import epochs_in
from serd_sim.world.observation import FAULT, Observation, ObservationInbox, episode_rng
from serd_sim.world.waypoint import REPEAT_PERIOD_S, FollowedDirective, Waypoint, waypoint_of_intent
from serd_sim.world.world import HallwayWorld

#: A fault begins when the robot drives at this share of its largest speed, after this time (s).
_FULL_SPEED = 0.9
_EARLIEST_S = 1.0
#: The robot stands below this speed.
_STANDING_MPS = 0.02
#: How long an episode goes on after a fault has begun.
WATCHED_S = 9.0
#: The planner stops when no observation has arrived for this time, as the node does.
_SILENT_S = 0.5


@dataclass(frozen=True)
class FaultTask(EpisodeTask):
    """An episode with a fault; people_from: as the fault needs it."""

    fault: str = "none"


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
COLUMNS = (*columns_of(FaultTask), Column(INPUTS, str), *columns_of(FaultOutcome))


def tasks_of(
    faults: Iterable[str], condition: EpisodeTask, seeds: Iterable[int]
) -> list[FaultTask]:
    """Every fault with and without the guard on every seed, else as `condition` has it."""
    return [
        FaultTask(
            **asdict(replace(condition, seed=seed, people_from=kind.people_from, guarded=guarded)),
            fault=fault,
        )
        for fault, kind in ((fault, fault_named(fault)) for fault in faults)
        for guarded in (0, 1)
        for seed in seeds
    ]


def run_fault(task: FaultTask) -> Row:
    """Run one episode; its row."""
    scenario = scenario_of(task.scenario, task.n_people)
    with HallwayWorld(scenario, seed=task.seed) as world:
        outcome = _FaultyEpisode(world, task).run()
    inputs = inputs_digest(task.scenario, task.driver)
    return {**asdict(task), INPUTS: inputs, **asdict(outcome)}


class _LivePlanner:
    """The local planner of the live stack: it plans on the newest complete observation."""

    def __init__(self, scenario: Scenario, people_from: str) -> None:
        self._perception = ScanPerception(scenario) if people_from == "scan" else None
        self._scan: Message | None = None
        self._planner = make_planner(scenario)
        self._cells = scenario.cells
        self._epochs = epochs_in(scenario)
        self._followed = FollowedDirective(scenario)
        needs_people = self._perception is None
        self._inbox = ObservationInbox(scenario.control_period_s, needs_people=needs_people)
        self._arrived_s = -math.inf
        self.observation: Observation | None = None
        self._directed: Waypoint | None = None

    def receive(self, messages: Messages, now_s: float) -> None:
        for each in messages:
            observation = self._completed_by(each)
            if observation is not None:
                self.observation, self._arrived_s = observation, now_s
            self._match()

    def _completed_by(self, message: Message) -> Observation | None:
        time_ns = round(message.stamp_s * 1e9)
        if message.source is Source.POSE:
            return self._inbox.take_pose(time_ns, message.value)
        if message.source is Source.ODOMETRY:
            return self._inbox.take_speeds(time_ns, message.value[1])
        if message.source is Source.PEOPLE:
            return self._inbox.take_people(time_ns, message.value)
        self._scan = message
        return None

    def _match(self) -> None:
        """Find people in a scan once the observation of its stamp is there."""
        scan, observation = self._scan, self.observation
        if self._perception is None or scan is None or observation is None:
            return
        if round(scan.stamp_s * 1e9) == round(observation.time_s * 1e9):
            self._perception.take(observation, scan.value.ranges_m)
            self._scan = None

    def decide(self, driver: Driver) -> bool:
        """Take the waypoint of the decision epoch that begins now; whether one begins."""
        observation = self.observation
        if observation is None or not self._epochs.begins(observation):
            return False
        action = driver.decide(observation, self._epochs.state)
        self._epochs.take(observation.time_s, action)
        self._directed = waypoint_of_intent(self._cells, observation, action)
        self.repeat()
        return True

    def repeat(self) -> None:
        """Take the last waypoint again, as a source does that goes on."""
        if self.observation is not None and self._directed is not None:
            self._followed.take(self.observation.time_s, self._directed)

    def command(self, now_s: float) -> Command:
        seen = self.observation
        if seen is None or now_s - self._arrived_s > _SILENT_S:
            return STOP
        waypoint = self._followed.waypoint(seen)
        return self._planner.step(
            self._perception.see(seen) if self._perception else seen, waypoint
        )


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
        self._world, self._task, self._kind = world, task, fault_named(task.fault)
        self._driver = make_driver(task.driver, scenario, task.seed)
        self._planner = _LivePlanner(scenario, task.people_from)
        settings = GuardSettings.of_scenario(scenario, task.people_from)
        self._guard = Guard(settings, scenario.wall_segments_m) if task.guarded else None
        rng = episode_rng(task.seed, task.episode, FAULT)
        self._channel = self._kind.make(rng, scenario.control_period_s)
        self._watch = _Watch()
        self._repeat_ticks = round(REPEAT_PERIOD_S / scenario.control_period_s)
        self._stopped_for: bool | None = None
        self._n_stops: Counter[bool] = Counter()

    def run(self) -> FaultOutcome:
        world, watch, kind = self._world, self._watch, self._kind
        observation = world.reset(self._task.episode, self._task.start_area)
        self._driver.begin(self._task.episode)
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
        messages = published(self._world, observation)
        if self._watch.start is not None:
            messages = self._channel(messages)
        planner.receive(messages, now_s)
        silent = self._kind.ends_waypoints and self._watch.start is not None
        repeats = observation.tick % self._repeat_ticks == 0
        if not silent and not planner.decide(self._driver) and repeats:
            planner.repeat()
        command = planner.command(now_s)
        if self._guard is None:
            return command
        output = guarded(self._guard, messages, command, now_s)
        self._count(output)
        return output.command

    def _count(self, output: GuardOutput) -> None:
        """Count stops when they begin, by whether an input or an obstacle is the reason."""
        stops = output.action is GuardAction.STOP
        cause = output.reasons[0].fault is not Fault.COLLISION if stops else None
        if cause is not None and cause != self._stopped_for:
            self._n_stops[cause] += 1
        self._stopped_for = cause
