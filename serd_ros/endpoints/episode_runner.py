"""Runs the episodes of a driver: resets the world, decides once per epoch, writes the results."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from diagnostic_msgs.msg import DiagnosticArray

from serd_app.drives.drive import END, START
from serd_core.grid.grid import Action
from serd_files.table import EpisodeResult, write_rows
from serd_ros.convert.diagnostics import UNCOUNTED, from_world_report
from serd_ros.convert.stamp import Jump, stamp_ns, to_stamp
from serd_ros.endpoints import qos, topics
from serd_ros.endpoints.episodes import EpisodeStarter
from serd_ros.endpoints.robot import ObservationSource
from serd_ros.process.progress import Progress, write_progress
from serd_ros.process.serd_node import Endpoints
from serd_ros.settings import DriverConfig
from serd_sim.drivers.catalogue import Driver
from serd_sim.episodes.episode import Ending, EpisodeProgress, EpisodeStart, observed_result
from serd_sim.scenario.scenario import Scenario
from serd_sim.world.epochs import epochs_in
from serd_sim.world.observation import Observation

_CLOCK_ROUNDING_S = 1e-6
#: Without a reset, an episode begins with an observation of at most this wall time ago (s), or of
#: two control periods where these are longer.
_FRESH_S = 0.5


@dataclass
class _Drive:
    """A running episode. started_wall_s: when its first observation came, with `progress`."""

    episode: EpisodeStart
    progress: EpisodeProgress | None = None
    started_wall_s: float = 0.0
    #: The action of the running epoch, and the tick that was followed last.
    action: Action = Action.WAIT
    followed_tick: int = -1
    ending: tuple[Ending, Observation] | None = None
    reason: str = ""


class EpisodeRunner:
    """Runs `config.episodes` episodes one after the other, then ends the process.

    steer: publishes the action of an observation for the local planner, with its stamp.
    results: of the episodes before, to which those of this runner are added.
    needs_people: whether decisions depend on people.
    start: where the world is not reset, what begins when an episode may begin; None begins none.
    give_up: why the episode is given up at the decision just taken; empty to go on.
    on_end: called with each finished episode, before the next one begins.
    on_new_session: called when the clock fell back.
    lack: what the driver still lacks, empty for nothing; episodes wait for it.
    """

    def __init__(
        self,
        endpoints: Endpoints,
        config: DriverConfig,
        scenario: Scenario,
        driver: Driver,
        steer: Callable[[Observation, Action], None],
        results: list[EpisodeResult],
        *,
        needs_people: bool = True,
        start: Callable[[], EpisodeStart | None] | None = None,
        give_up: Callable[[], str] = lambda: "",
        on_end: Callable[[EpisodeResult], None] = lambda _: None,
        on_new_session: Callable[[], None] = lambda: None,
        lack: Callable[[], str] = lambda: "",
    ) -> None:
        self.scenario, self.driver = scenario, driver
        #: The newest observation.
        self.observation: Observation | None = None
        self._node, self._config, self._results = endpoints.node, config, results
        self._steer, self._start_of, self._give_up = steer, start, give_up
        self._on_end, self._on_new_session = on_end, on_new_session
        self._resets_world = start is None
        self._epochs = epochs_in(scenario)
        self._drive: _Drive | None = None
        #: With the wall time at which it came.
        self._waiting: tuple[Observation, float] | None = None
        #: Stamps and counts of the world, from those at the begin of the episode on.
        self._world_reports = list[tuple[int, dict[str, str]]]()
        if scenario.patience_remark:
            self._node.get_logger().warning(scenario.patience_remark)
        endpoints.subscribe(DiagnosticArray, topics.DIAGNOSTICS, self._on_diagnostics, qos.STATE)
        ObservationSource(
            endpoints, scenario.control_period_s, self._on_observation, config,
            on_jump=self._on_jump, needs_people=needs_people,
        )  # fmt: skip
        #: The topics of a world that this node depends on.
        follows_clock = self._resets_world or self._node.get_parameter("use_sim_time").value
        clock, takes_pose = bool(follows_clock), config.pose_from == topics.ROBOT_POSE
        world_topics = [topics.CLOCK] * clock + [topics.ROBOT_POSE] * takes_pose
        self._starter = EpisodeStarter(
            endpoints, config.required_nodes,
            on_ready=self.next_episode, on_start=self._begin_episode, on_wait=self._log_waiting,
            needs_reset=self._resets_world, world_topics=world_topics, lack=lack,
        )  # fmt: skip
        self._starter.wait()

    def set_scenario(self, scenario: Scenario) -> None:
        """End episodes in the goal area of this scenario from now on, the running one too."""
        self.scenario = scenario
        if self._drive is not None and self._drive.progress is not None:
            self._drive.progress.goal_area_m = scenario.goal_area_m

    @property
    def ready(self) -> bool:
        """Whether all that episodes need is there."""
        return not self._starter.waiting

    @property
    def driving(self) -> bool:
        """Whether an episode is running."""
        return self._drive is not None

    @property
    def n_finished(self) -> int:
        """How many episodes have ended."""
        return len(self._results)

    def next_episode(self) -> None:
        """Have the world reset, or begin what `start` returns."""
        self._drive = None
        if self._start_of is None:
            self._starter.reset_world()
        elif (episode := self._start_of()) is not None:
            self._starter.begin(episode)

    def discard(self) -> None:
        """Discard the running episode."""
        drive, self._drive = self._drive, None
        if self.observation is not None and drive is not None and drive.progress is not None:
            self._mark(END, self.observation, "discarded", drive.reason)

    def _on_jump(self, jump: Jump) -> None:
        """After a gap it decides anew; a new session ends the drive and begins another episode."""
        if jump is Jump.FORWARD:
            self._epochs.lose()
        if jump is Jump.BACKWARD:
            self._on_new_session()
            self._node.get_logger().warning("the clock fell back: the drive begins anew")
            self._drive = self._waiting = None
            self._world_reports.clear()
            self._starter.wait()

    def _log_waiting(self, missing: str) -> None:
        self._node.get_logger().info(f"waiting for {missing}")
        write_progress(Progress(text=f"waiting for {missing}"))

    def _begin_episode(self, episode: EpisodeStart) -> None:
        """Drive from the episode's first observation on, which may be here already."""
        self._drive = _Drive(episode)
        del self._world_reports[:-1]
        self.driver.begin(episode.episode)
        if self._waiting is not None:
            observation, received_s = self._waiting
            self._waiting = None
            # A world that was reset stands until its first observation is answered.
            fresh_s = max(_FRESH_S, 2 * self.scenario.control_period_s)
            if self._resets_world or self._node.wall_s() - received_s <= fresh_s:
                self._on_observation(observation)

    def _on_observation(self, observation: Observation) -> None:
        """Follow the episode; an observation may come before the reply that begins it."""
        self.observation, drive = observation, self._drive
        if drive is None:
            self._waiting = observation, self._node.wall_s()
            return
        self._waiting = None
        if observation.time_s < drive.episode.start_s - _CLOCK_ROUNDING_S:
            return
        if drive.progress is None:
            drive.progress = EpisodeProgress(self.scenario, observation, self._config.timeout_s)
            drive.started_wall_s = self._node.wall_s()
            self._epochs.begin()
            self._mark(START, observation)
        if drive.ending is None:
            ending = drive.progress.see(observation)
            drive.ending = None if ending is None else (ending, observation)
        self._follow_epochs(drive, observation)
        self._finish_when_reported()

    def _follow_epochs(self, drive: _Drive, observation: Observation) -> None:
        """Decide where an epoch begins; a tick that comes again gets the same answer."""
        begins = self._epochs.begins(observation)
        is_again = observation.tick == drive.followed_tick
        if begins and not is_again:
            drive.action = self._decided(drive, observation)
            self._epochs.take(observation.time_s, drive.action)
        drive.followed_tick = observation.tick
        if begins or is_again:
            self._steer(observation, drive.action)

    def _decided(self, drive: _Drive, observation: Observation) -> Action:
        """What the driver decides; to wait where it gives up, and until the end is reported."""
        if drive.ending is not None:
            return Action.WAIT
        action = self.driver.decide(observation, self._epochs.state)
        drive.reason = self._give_up()
        if not drive.reason:
            return action
        drive.ending = "aborted", observation
        return Action.WAIT

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        if (report := from_world_report(message)) is not None:
            self._world_reports.append(report)
            self._finish_when_reported()

    def _finish_when_reported(self) -> None:
        """End the episode when the world's count of contacts at its last tick has arrived."""
        drive = self._drive
        if drive is None or drive.ending is None or drive.progress is None:
            return
        ending, observation = drive.ending
        report = self._world_report(observation)
        if report is None:
            return
        self._mark(END, observation, ending, drive.reason)
        wall_s = self._node.wall_s() - drive.started_wall_s
        result = observed_result(
            drive.episode, drive.progress, report,
            driver=self.driver.name, outcome=ending, reason=drive.reason, wall_s=wall_s,
        )  # fmt: skip
        self._results.append(result)
        if self._config.output and self._resets_world:  # contacts are counted
            write_rows(Path(self._config.output) / "episodes.csv", EpisodeResult, self._results)
        self._log_result(result)
        self._on_end(result)
        if len(self._results) < self._config.episodes:
            self.next_episode()
        else:
            self._drive = None
            self._node.finish(0)

    def _world_report(self, observation: Observation) -> dict[str, str] | None:
        """The world's counts at an observation, of its last change; None until they arrive."""
        if not self._resets_world:
            return UNCOUNTED
        time_ns = stamp_ns(to_stamp(observation.time_s))
        if not self._world_reports or self._world_reports[-1][0] < time_ns:
            return None
        until_then = [report for at_ns, report in self._world_reports if at_ns <= time_ns]
        return until_then[-1] if until_then else self._world_reports[0][1]

    def _log_result(self, result: EpisodeResult) -> None:
        ending = f"{result.outcome} ({result.reason})" if result.reason else result.outcome
        speed = result.duration_s / max(result.wall_s, 1e-6)  # one that arrives at once has none
        text = f"{ending} after {result.duration_s:.1f} s ({speed:.1f} times real time)"
        self._node.get_logger().info(
            f"episode {self.n_finished} of {self._config.episodes}: {text}"
        )
        write_progress(Progress(text=text, done=self.n_finished))

    def _mark(
        self, event: str, observation: Observation, outcome: str = "", reason: str = ""
    ) -> None:
        driver = self.driver.name
        self._starter.mark(event, observation.time_s, driver, outcome=outcome, reason=reason)
