"""A node that drives episodes: resets the world, decides once per epoch, writes the results.

The scripted expert and the strategy are this node with different drivers and steering topics.
"""

from abc import abstractmethod
from pathlib import Path
from typing import ClassVar, TypeVar

from diagnostic_msgs.msg import DiagnosticArray

from serd_app.drives.episode_spans import END, START
from serd_core.grid.grid import Action
from serd_files.episode_table import EpisodeResult
from serd_files.table import write_rows
from serd_ros.convert.diagnostics import from_world_report
from serd_ros.convert.stamp import Jump, stamp_ns, to_stamp
from serd_ros.endpoints import qos, topics
from serd_ros.endpoints.observation import ObservationSource
from serd_ros.endpoints.world.worlds import several_worlds
from serd_ros.episodes.starter import EpisodeStarter
from serd_ros.graph.configs import DriverConfig
from serd_ros.process.managed_node import ManagedNode
from serd_ros.process.progress import Progress, write_progress
from serd_sim.drivers.catalogue import Driver
from serd_sim.episodes.episode import Ending, EpisodeProgress
from serd_sim.episodes.result import EpisodeStart, observed_result
from serd_sim.scenario.grid import grid_of
from serd_sim.scenario.scenario import Scenario, load_scenario
from serd_sim.world.epochs import epochs_in
from serd_sim.world.observation import Observation

Config = TypeVar("Config", bound=DriverConfig)
_CLOCK_ROUNDING_S = 1e-6
#: Without a reset, an episode begins with an observation of at most this wall time ago (s), or of
#: two control periods where these are longer.
_FRESH_S = 0.5
_LOOK_PERIOD_S = 1.0


class EpisodeDriverNode(ManagedNode[Config]):
    """Runs `episodes` episodes one after the other, then ends its process.

    needs_people: whether decisions depend on people.
    """

    needs_people: ClassVar[bool] = True

    def configure(self) -> None:
        """Load the scenario and make the driver."""
        self.scenario: Scenario = load_scenario(self.config.scenario)
        self.driver: Driver = self.make_driver()
        if self.scenario.patience_remark:
            self.get_logger().warning(self.scenario.patience_remark)
        self._results: list[EpisodeResult] = []
        self._epochs = epochs_in(self.scenario, grid_of(self.scenario))

    def activate(self) -> None:
        """Wait for the graph, then drive."""
        self._running: EpisodeStart | None = None
        self._observation: Observation | None = None
        self._progress: EpisodeProgress | None = None
        #: With the wall time at which it came.
        self._waiting: tuple[Observation, float] | None = None
        #: The action of the running epoch, and the tick that was followed last.
        self._action, self._followed_tick = Action.WAIT, -1
        self._ending: tuple[Ending, Observation] | None = None
        self._reason = ""
        #: Stamps and counts of the world, from those at the begin of the episode on.
        self._world_reports = list[tuple[int, dict[str, str]]]()
        self._started_wall_s = 0.0
        self._waited_for = ""
        self.create_subscription(
            DiagnosticArray, topics.DIAGNOSTICS, self._on_diagnostics, qos.STATE
        )
        ObservationSource(
            self,
            self.scenario.control_period_s,
            self._on_observation,
            self.config,
            needs_people=self.needs_people,
        )
        self._starter = EpisodeStarter(
            self,
            self.config.required_nodes,
            on_ready=self._next_episode,
            on_start=self._begin_episode,
            on_wait=self._log_waiting,
            needs_reset=self.resets_world,
            world_topics=self._world_topics(),
        )
        self._starter.wait()
        self.create_timer(_LOOK_PERIOD_S, self._look_for_other_worlds)

    def deactivate(self) -> None:
        """Discard the running episode."""
        self._discard()
        super().deactivate()

    @abstractmethod
    def make_driver(self) -> Driver:
        """The driver that decides."""

    @abstractmethod
    def steer(self, observation: Observation, action: Action) -> None:
        """Publish the action for the local planner, with the observation's stamp."""

    def give_up_reason(self) -> str:
        """Why the episode is given up at the decision just taken; empty to go on."""
        return ""

    def episode_ended(self, result: EpisodeResult) -> None:
        """Called with every finished episode, before the next begins."""

    def episode_begun(self) -> None:
        """Called before the first observation of an episode."""

    def set_scenario(self, scenario: Scenario) -> None:
        """End episodes in the goal area of this scenario from now on, the running one too."""
        self.scenario = scenario
        if self._progress is not None:
            self._progress.goal_area_m = scenario.goal_area_m

    def clock_jumped(self, jump: Jump) -> None:
        """After a gap it decides anew; a new session ends the drive and begins another episode."""
        if jump is Jump.FORWARD:
            self._epochs.lose()
        if jump is Jump.BACKWARD:
            self.get_logger().warning("the clock fell back: the drive begins anew")
            self._clear()
            self._waiting = None
            self._world_reports.clear()
            self._starter.wait()

    def _world_topics(self) -> list[str]:
        """The topics of a world that this node depends on."""
        follows_clock = self.resets_world or self.get_parameter("use_sim_time").value
        takes_pose = self.config.pose_from == topics.ROBOT_POSE
        return [topics.CLOCK] * bool(follows_clock) + [topics.ROBOT_POSE] * takes_pose

    def _look_for_other_worlds(self) -> None:
        """Discard the episode while several nodes publish the world; another one begins after."""
        several = several_worlds(self, self._world_topics()) if self.driving else ""
        if not several:
            return
        self.get_logger().error(f"there must be {several}; the episode is discarded")
        self._discard()
        self._waiting = None
        self._starter.wait()

    def _discard(self) -> None:
        if self._observation is not None and self._progress is not None:
            self._mark(END, self._observation, "discarded")
        self._clear()

    def _log_waiting(self, missing: str) -> None:
        if missing != self._waited_for:
            self._waited_for = missing
            self.get_logger().info(f"waiting for {missing}")
            write_progress(Progress(text=f"waiting for {missing}"))

    @property
    def observation(self) -> Observation | None:
        """The newest observation."""
        return self._observation

    @property
    def ready(self) -> bool:
        """Whether all that episodes need is there."""
        return not self._starter.waiting

    @property
    def n_finished(self) -> int:
        """How many episodes have ended."""
        return len(self._results)

    @property
    def driving(self) -> bool:
        """Whether an episode is running."""
        return self._running is not None

    @property
    def resets_world(self) -> bool:
        """Whether the world is reset before each episode."""
        return True

    def _next_episode(self) -> None:
        self._clear()
        self.request_episode()

    def _clear(self) -> None:
        self._running, self._progress, self._ending = None, None, None
        self._reason, self._followed_tick = "", -1

    def request_episode(self) -> None:
        """Request the next episode; a node that does not reset the world calls `begin_episode`."""
        self._starter.reset_world()

    def begin_episode(self, episode: EpisodeStart) -> None:
        """Begin an episode without a reset."""
        self._starter.begin(episode)

    def _begin_episode(self, episode: EpisodeStart) -> None:
        """Drive from the episode's first observation on, which may be here already."""
        self._running = episode
        del self._world_reports[:-1]
        self.driver.begin(episode.episode)
        if self._waiting is not None:
            observation, received_s = self._waiting
            self._waiting = None
            # A world that was reset stands until its first observation is answered.
            fresh_s = max(_FRESH_S, 2 * self.scenario.control_period_s)
            if self.resets_world or self.wall_s() - received_s <= fresh_s:
                self._on_observation(observation)

    def _on_observation(self, observation: Observation) -> None:
        """Follow the episode; an observation may come before the reply that begins it."""
        self._observation = observation
        if self._running is None:
            self._waiting = observation, self.wall_s()
            return
        self._waiting = None
        if observation.time_s < self._running.start_s - _CLOCK_ROUNDING_S:
            return
        if self._progress is None:
            self._start(observation)
        assert self._progress is not None
        if self._ending is None:
            ending = self._progress.see(observation)
            self._ending = None if ending is None else (ending, observation)
        self._follow_epochs(observation)
        self._finish_when_reported()

    def _start(self, observation: Observation) -> None:
        self._progress = EpisodeProgress(self.scenario, observation, self.config.timeout_s)
        self._epochs.begin()
        self.episode_begun()
        self._started_wall_s = self.wall_s()
        self._mark(START, observation)

    def _follow_epochs(self, observation: Observation) -> None:
        """Decide where an epoch begins.

        A tick that comes again is one that a receiver has missed, and gets the same answer.
        """
        begins = self._epochs.begins(observation)
        is_again = observation.tick == self._followed_tick
        if begins and not is_again:
            self._action = self._decided(observation)
            self._epochs.take(observation.time_s, self._action)
        self._followed_tick = observation.tick
        if begins or is_again:
            self.steer(observation, self._action)

    def _decided(self, observation: Observation) -> Action:
        """What the driver decides; to wait where it gives up, and until the end is reported."""
        if self._ending is not None:
            return Action.WAIT
        action = self.driver.decide(observation, self._epochs.state)
        self._reason = self.give_up_reason()
        if not self._reason:
            return action
        self._ending = "aborted", observation
        return Action.WAIT

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        report = from_world_report(message)
        if report is not None:
            self._world_reports.append(report)
            self._finish_when_reported()

    def _finish_when_reported(self) -> None:
        """End the episode when the world's count of contacts at its last tick has arrived."""
        if self._ending is None or self._running is None:
            return
        ending, observation = self._ending
        report = self.world_report(observation)
        if report is None:
            return
        self._mark(END, observation, ending)
        self._results.append(self._result(ending, report))
        self.save_results()
        self._log_result(self._results[-1])
        self.episode_ended(self._results[-1])
        if len(self._results) < self.config.episodes:
            self._next_episode()
        else:
            self._running = None
            self.finish(0)

    def world_report(self, observation: Observation) -> dict[str, str] | None:
        """The world's counts at an observation; None while they have not arrived.

        The world reports at each change: those at a tick are the last ones until then.
        """
        time_ns = stamp_ns(to_stamp(observation.time_s))
        if not self._world_reports or self._world_reports[-1][0] < time_ns:
            return None
        until_then = [report for at_ns, report in self._world_reports if at_ns <= time_ns]
        return until_then[-1] if until_then else self._world_reports[0][1]

    def _result(self, ending: Ending, report: dict[str, str]) -> EpisodeResult:
        assert self._running is not None
        assert self._progress is not None
        return observed_result(
            self._running,
            self._progress,
            report,
            driver=self.driver.name,
            outcome=ending,
            reason=self._reason,
            wall_s=self.wall_s() - self._started_wall_s,
        )

    def save_results(self) -> None:
        """Write the table of all episodes so far."""
        if self.config.output:
            write_rows(Path(self.config.output) / "episodes.csv", EpisodeResult, self._results)

    def _log_result(self, result: EpisodeResult) -> None:
        ending = f"{result.outcome} ({result.reason})" if result.reason else result.outcome
        text = (
            f"{ending} after {result.duration_s:.1f} s "
            f"({result.duration_s / result.wall_s:.1f} times real time)"
        )
        self.get_logger().info(f"episode {self.n_finished} of {self.config.episodes}: {text}")
        write_progress(Progress(text=text, done=self.n_finished))

    def _mark(self, event: str, observation: Observation, outcome: str = "") -> None:
        self._starter.mark(
            event, observation.time_s, self.driver.name, outcome=outcome, reason=self._reason
        )
