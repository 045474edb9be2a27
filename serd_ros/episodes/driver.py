"""A node that drives episodes: resets the world, decides once per period, writes what came of it.

The scripted expert and the strategy are this node with another driver and another topic to steer
by. Nothing sleeps: the first reset waits until the nodes it needs are there and all endpoints
between them are matched.
"""

from abc import abstractmethod
from pathlib import Path
from typing import TypeVar

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.task import Future
from std_srvs.srv import Trigger

from serd_core.grid.grid import Action
from serd_ros.convert.diagnostics import values_of
from serd_ros.convert.episode_mark import END, START, EpisodeMark, to_episode_message
from serd_ros.convert.reset_reply import ResetReply, from_reset_sentence
from serd_ros.convert.stamp import stamp_ns, to_stamp
from serd_ros.endpoints import qos, topics
from serd_ros.endpoints.observation import subscribe_observations
from serd_ros.episodes.result import episode_result
from serd_ros.graph.readiness import Readiness
from serd_ros.parameters.configs import DriverConfig
from serd_ros.process.serd_node import SerdNode
from sim.drivers.catalogue import Driver
from sim.episodes.progress import Ending, EpisodeProgress
from sim.scenario.scenario import Scenario, load_scenario
from sim.world.observation import Observation
from sim.world.waypoint import is_decision_tick
from storage.episode_table import EpisodeResult, save_episodes

Config = TypeVar("Config", bound=DriverConfig)
_LOOK_AGAIN_S = 0.1
_SAY_AGAIN_S = 5.0
_CLOCK_ROUNDING_S = 1e-6


class EpisodeDriverNode(SerdNode[Config]):
    """Runs `episodes` episodes one after the other, then ends its process."""

    def __init__(self, kind: str, config_class: type[Config]) -> None:
        super().__init__(kind, config_class)
        self.scenario: Scenario = load_scenario(self.config.scenario)
        self.driver: Driver = self.make_driver()
        self._results: list[EpisodeResult] = []
        self._running: ResetReply | None = None
        self._progress: EpisodeProgress | None = None
        self._waiting: Observation | None = None
        self._decision: tuple[int, Action] | None = None
        self._ending: tuple[Ending, Observation] | None = None
        self._reason = ""
        self._world_report: tuple[int, dict[str, str]] | None = None
        self._said_wall_s = self.wall_s()
        self._started_wall_s = 0.0
        self._marks = self.create_publisher(DiagnosticArray, topics.EPISODE, qos.STATE)
        self._reset = self.create_client(Trigger, topics.RESET)
        self.create_subscription(
            DiagnosticArray, topics.DIAGNOSTICS, self._on_diagnostics, qos.STATE
        )
        subscribe_observations(self, self.scenario.control_period_s, self._on_observation)
        self._readiness = Readiness(self, self.config.required_nodes, self.wall_s())
        self._look = self.create_timer(_LOOK_AGAIN_S, self._begin_when_ready, clock=self.wall_clock)

    @abstractmethod
    def make_driver(self) -> Driver:
        """Who decides."""

    @abstractmethod
    def steer(self, observation: Observation, action: Action) -> None:
        """Tell the local planner, with the observation's stamp."""

    def give_up_reason(self) -> str:
        """Why the episode is given up at the decision just taken; empty to go on."""
        return ""

    def episode_ended(self, result: EpisodeResult) -> None:
        """Called with every finished episode, before the next begins."""

    def aim(self, scenario: Scenario) -> None:
        """Let episodes end in another goal area from now on, the running one too."""
        self.scenario = scenario
        if self._progress is not None:
            self._progress.set_goal(scenario.goal_area_m)

    def _begin_when_ready(self) -> None:
        """Wait for the graph, then begin the first episode."""
        missing = self._readiness.missing(self.wall_s()) or self.missing_for_episode()
        if missing:
            self._say_waiting(missing)
        else:
            self._look.cancel()
            self._next_episode()

    def _say_waiting(self, missing: str) -> None:
        if self.wall_s() - self._said_wall_s > _SAY_AGAIN_S:
            self._said_wall_s = self.wall_s()
            self.get_logger().info(f"waiting for {missing}")

    @property
    def ready(self) -> bool:
        """Whether all that episodes need is there."""
        return bool(self._look.is_canceled())

    @property
    def driving(self) -> bool:
        """Whether an episode is under way."""
        return self._running is not None

    def missing_for_episode(self) -> str:
        """What an episode cannot begin without, beside nodes and endpoints; empty when ready."""
        return "" if self._reset.service_is_ready() else "the reset service"

    def _next_episode(self) -> None:
        self._running, self._progress, self._decision, self._ending = None, None, None, None
        self._reason = ""
        self.ask_for_episode()

    def ask_for_episode(self) -> None:
        """Have the world reset; whoever begins otherwise calls `begin_episode` when it is time."""
        self._reset.call_async(Trigger.Request()).add_done_callback(self._on_reset)

    def _on_reset(self, future: Future) -> None:
        reply = future.result()
        if not reply.success:
            self._say_waiting(reply.message)
            self._look.reset()
            return
        self.begin_episode(from_reset_sentence(reply.message))

    def begin_episode(self, episode: ResetReply) -> None:
        """Drive from the episode's first observation on, which may be here already."""
        self._running = episode
        self.driver.begin(episode.episode)
        if self._waiting is not None:
            self._on_observation(self._waiting)

    def _on_observation(self, observation: Observation) -> None:
        """Follow the episode; an observation may come before the reply that begins it."""
        if self._running is None:
            self._waiting = observation
            return
        self._waiting = None
        earlier = observation.time_s < self._running.start_s - _CLOCK_ROUNDING_S
        if earlier or self._ending is not None:
            return
        if self._progress is None:
            self._start(observation)
        assert self._progress is not None
        ending = self._progress.see(observation)
        if ending is not None:
            self._ending = ending, observation
            self._finish_when_reported()
        elif is_decision_tick(observation, self.scenario):
            self._decide(observation)

    def _start(self, observation: Observation) -> None:
        self._progress = EpisodeProgress(self.scenario, observation, self.config.timeout_s)
        self._started_wall_s = self.wall_s()
        self._mark(START, observation)

    def _decide(self, observation: Observation) -> None:
        """Decide once per decision tick; a tick that comes again gets the same answer."""
        if self._decision is None or self._decision[0] != observation.tick:
            self._decision = observation.tick, self.driver.decide(observation)
            self._reason = self.give_up_reason()
        if self._reason:
            self._ending = "aborted", observation
            self._finish_when_reported()
        else:
            self.steer(observation, self._decision[1])

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        values = values_of(message, "hallway_sim")
        if values is not None:
            self._world_report = stamp_ns(message.header.stamp), values
            self._finish_when_reported()

    def _finish_when_reported(self) -> None:
        """End the episode once the world's own count of contacts at its last tick is here."""
        if self._ending is None or self._running is None:
            return
        ending, observation = self._ending
        report = self.world_report(observation)
        if report is None:
            return
        self._mark(END, observation, ending)
        self._results.append(self._result(ending, report))
        self.save_results()
        self._tell(self._results[-1])
        self.episode_ended(self._results[-1])
        if len(self._results) < self.config.episodes:
            self._next_episode()
        else:
            self._running = None
            self.finish(0)

    def world_report(self, observation: Observation) -> dict[str, str] | None:
        """What the world counted up to an observation; None while it has not said so yet."""
        if self._world_report is None:
            return None
        time_ns, report = self._world_report
        return report if time_ns >= stamp_ns(to_stamp(observation.time_s)) else None

    def _result(self, ending: Ending, report: dict[str, str]) -> EpisodeResult:
        assert self._running is not None
        assert self._progress is not None
        return episode_result(
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
            save_episodes(Path(self.config.output) / "episodes.csv", self._results)

    def _tell(self, result: EpisodeResult) -> None:
        self.get_logger().info(
            f"episode {len(self._results)} of {self.config.episodes}: {result.outcome}"
            f"{f' ({result.reason})' if result.reason else ''} after {result.duration_s:.1f} s "
            f"({result.duration_s / result.wall_s:.1f} times real time)"
        )

    def _mark(self, event: str, observation: Observation, outcome: str = "") -> None:
        assert self._running is not None
        mark = EpisodeMark(
            event=event,
            time_s=observation.time_s,
            episode=self._running.episode,
            driver=self.driver.name,
            seed=self._running.seed,
            start_area=self._running.start_area,
            outcome=outcome,
            reason=self._reason,
        )
        self._marks.publish(to_episode_message(mark))
