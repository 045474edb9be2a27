"""learner: demonstrations become a model file, from a bag or from topics as they come, as a node.

Live, it learns at the end of each episode, beginning where the last fit ended, or on a call of
`learn`, beginning anew. What it has seen and where its fit stands is kept on disk after each.
"""

from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Literal

from diagnostic_msgs.msg import DiagnosticArray
from std_msgs.msg import String
from std_srvs.srv import Trigger

from serd_app.demonstrations.decision_table import Place, save_learnable
from serd_app.demonstrations.discretise import demonstrations_of_bag
from serd_app.demonstrations.live import LiveDrive, MappedLiveDrive
from serd_app.drives.mapping import BagMapping
from serd_app.learning.checkpoint import FitWorker, LearnerMemory
from serd_app.learning.learning_files import until_goal
from serd_app.learning.methods import FitProgress
from serd_app.learning.outcome import FitOutcome, save_outcome
from serd_app.learning.recipe import LearningTask, learn, require_enough, task_in
from serd_app.learning.settings import LearningSettings
from serd_app.places.kept_scenario import require_replaceable
from serd_bag.errors import BagError
from serd_bag.files import require_file_place
from serd_core.demonstrations.decisions import TimedDecisions
from serd_files.errors import USER_ERRORS
from serd_files.settings import setting, setting_of
from serd_files.yaml_config import load_yaml_model, model_yaml
from serd_ros.convert.diagnostics import OK, WARN
from serd_ros.endpoints import qos, topics
from serd_ros.endpoints.mapped_topics import MappedTopics
from serd_ros.endpoints.topic_types import topic_type
from serd_ros.errors import MessageError, NodeError
from serd_ros.process.progress import Progress, write_progress
from serd_ros.process.serd_node import Activate, Activity, Endpoints, SerdNode
from serd_ros.settings import ManagedConfig
from serd_sim.episodes.episode import EpisodeSettings
from serd_sim.scenario.grid import grid_of
from serd_sim.scenario.scenario import Scenario, load_scenario

_LOOK_PERIOD_S = 0.1
_CHECKPOINT_PERIOD_S = 1.0
#: Intents may come this much later (s) than the end mark of their episode; later, it counts anew.
_SETTLING_S = 0.5
#: Episodes of a mapping are counted this often (s), or in at most this share of the time.
_COUNT_PERIOD_S, _COUNT_SHARE = 2.0, 10.0
_UNCONVERGED = 1
_REPLAY = "bag_replay"


class LearnerConfig(LearningSettings, ManagedConfig):
    """Parameters of learner."""

    scenario: str = setting_of(EpisodeSettings, "scenario")
    bag: str = setting("", "learn from this bag at start; from live topics when empty")
    mapping: str = setting(
        "", "YAML file of the topics of another robot, as of serd demos; ours when empty"
    )
    learn_on: Literal["call", "episode"] = setting(
        "episode",
        "live: learn at the end of each episode, or when the service learn is called",
        live="any",
    )
    state: str = setting("", "live: folder of checkpoints; beside the output when empty")
    output: str = setting("model.yaml", "model file to write", min_length=1)
    decisions: str = setting("", "also write the table of decisions to this file")
    flow: str = setting("", "table of the flow of people by `serd demos`; else the scenario's own")
    exit_with_publishers: bool = setting(
        False, "live: end when a replay is over or nothing publishes any more, and all is learned"
    )


class LearnerNode(SerdNode[LearnerConfig]):
    """Learns while it is active."""

    config_class = LearnerConfig

    def configure(self) -> Activate:
        """Read the scenario and what an earlier learner kept."""
        config = self.config
        scenario = load_scenario(config.scenario)
        task = task_in(scenario, config.discount, config.flow)
        place = Place(grid_of(scenario), scenario.patience_s, scenario.wait_s, scenario)
        require_file_place(Path(config.output))
        if config.decisions:
            require_file_place(Path(config.decisions))
            require_replaceable(Path(config.decisions), task.scenario_yaml)
        require_replaceable(Path(config.output), task.scenario_yaml)
        mapping = load_yaml_model(Path(config.mapping), BagMapping) if config.mapping else None
        memory = None if config.bag else self._memory_of(scenario, task, mapping)
        return partial(Learning, task, place, memory, mapping)

    def _memory_of(
        self, scenario: Scenario, task: LearningTask, mapping: BagMapping | None
    ) -> LearnerMemory:
        config, output = self.config, Path(self.config.output)
        memory = LearnerMemory(
            scenario,
            Path(config.state or output.with_name(f"{output.stem}_learner")),
            feature_names=task.problem.feature_names,
            mapping=mapping,
        )
        self.get_logger().info(f"{memory.n_decisions} decisions kept in {memory.folder.path}")
        if remark := memory.start_remark:
            self.get_logger().warning(remark)
        return memory


class Learning(Activity):
    """Takes decisions and learns in a thread; memory: of what was shown, None with a bag."""

    def __init__(
        self,
        task: LearningTask,
        place: Place,
        memory: LearnerMemory | None,
        mapping: BagMapping | None,
        endpoints: Endpoints,
    ) -> None:
        self._node = endpoints.node
        self._task, self._place, self._memory, self._mapping = task, place, memory, mapping
        self._topics: MappedTopics | None = None
        #: When episodes are counted again, and how many messages had come at the last end.
        self._count_due_s, self._n_gathered = 0.0, 0
        self._again = self._begin_anew = False
        self._begun_s = 0.0
        # An episode that ended before a deactivation is still to be gathered.
        n_ended = 0 if memory is None else memory.drive.n_ended
        self._ended_s = self._node.wall_s() if n_ended else None
        #: Wall time at which a message came or something published; None before.
        self._heard_s = self._ended_s
        self._is_played = False
        #: Why there is no model of all that was shown; empty where there is one.
        self._refusal = "no episode has ended"
        self._checkpoint_due_s = 0.0
        self._is_gathered_to_its_end = False
        self._worker = FitWorker()
        if memory is not None:
            self._listen(endpoints, memory)
        self._models = endpoints.publisher(String, topics.MODEL, qos.LATCHED)
        endpoints.serve(Trigger, topics.LEARN, self._on_learn)
        endpoints.every(_LOOK_PERIOD_S, self._look)
        if memory is None or (memory.unlearned and self._node.config.learn_on == "episode"):
            self._begin(anew=False)

    def close(self) -> None:
        """End a fit that is under way; its last checkpoint is kept."""
        self._worker.stop()

    def _listen(self, endpoints: Endpoints, memory: LearnerMemory) -> None:
        if isinstance(memory.drive, MappedLiveDrive):
            self._topics = MappedTopics(endpoints, memory.drive, self._hear)
        for topic in (
            () if self._topics is not None else (topics.ROBOT_POSE, topics.INTENT, topics.EPISODE)
        ):
            kind = topic_type(topic, stamped_cmd_vel=False)
            take = partial(self._take, memory, topic)
            endpoints.subscribe_raw(kind.message, topic, take, qos.LOSSLESS)
        if self._node.config.exit_with_publishers:
            take_report = self._on_diagnostics
            endpoints.subscribe(DiagnosticArray, topics.DIAGNOSTICS, take_report, qos.STATE)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        """The end of a replay, also of a bag without the topics that are learned from."""
        for status in message.status:
            if status.name == _REPLAY:
                self._is_played = status.message == "finished"
                self._heard_s = self._heard_s or self._node.wall_s()

    def _hear(self) -> None:
        self._heard_s = self._node.wall_s()

    def _count_episodes(self, drive: MappedLiveDrive, now_s: float) -> None:
        """Whether an episode has ended shows in all poses so far; looking takes its time."""
        if now_s < self._count_due_s or drive.n_messages == self._n_gathered:
            return
        before, self._n_gathered = drive.n_ended, drive.n_messages
        with suppress(BagError):  # before the first pose
            drive.look()
        took_s = self._node.wall_s() - now_s
        self._count_due_s = now_s + max(_COUNT_PERIOD_S, _COUNT_SHARE * took_s)
        if drive.n_ended != before:
            self._ended_s = now_s

    def _take(self, memory: LearnerMemory, topic: str, data: bytes) -> None:
        drive = memory.drive
        assert isinstance(drive, LiveDrive)
        before = (drive.n_ended, drive.n_late)
        self._heard_s = self._node.wall_s()
        try:
            drive.take(topic, data)
        except BagError as error:
            raise MessageError(f"message must be one of {topic}", error, "correct it") from None
        if (drive.n_ended, drive.n_late) != before:
            self._ended_s = self._node.wall_s()

    def _look(self) -> None:
        for event in self._worker.events():
            if isinstance(event, FitProgress):
                self._show(event)
            elif isinstance(event, FitOutcome):
                self._conclude(event)
            else:
                self._refuse(str(event))
        memory = self._memory
        if memory is not None and isinstance(memory.drive, MappedLiveDrive):
            self._count_episodes(memory.drive, self._node.wall_s())
        if memory is not None and self._settled(memory):
            self._ended_s = None
            self._gather_ended(memory)
        if (self._again or self._begin_anew) and not self._worker.busy:
            self._begin(anew=self._begin_anew)
        elif self._node.config.exit_with_publishers and not self._worker.busy:
            self._end_with_publishers()

    def _end_with_publishers(self) -> None:
        if self._ended_s is not None or not self._has_ended(self._node.wall_s()):
            return
        if self._topics is not None and not self._is_gathered_to_its_end:
            self._gather_to_its_end()
        elif self._refusal:
            self._node.fail(f"no model was learned: {self._refusal}")
        else:
            self._node.finish(0)

    def _gather_to_its_end(self) -> None:
        """Of a mapping: the last episode ends where the messages do, as in a bag."""
        self._is_gathered_to_its_end = True
        assert self._memory is not None
        self._gather_ended(self._memory, unfinished=True)

    def _settled(self, memory: LearnerMemory) -> bool:
        if self._ended_s is None:
            return False
        now_s = self._node.wall_s()
        is_due = now_s - self._ended_s >= _SETTLING_S
        return is_due and (memory.drive.caught_up or self._has_ended(now_s))

    def _has_ended(self, now_s: float) -> bool:
        """Whether nothing plays or publishes any more, and all that arrived has been taken."""
        if not self._is_played and self._has_publishers:
            self._heard_s = now_s
        if self._topics is not None and not self._topics.complete:
            return False
        return self._heard_s is not None and now_s - self._heard_s > _SETTLING_S

    @property
    def _has_publishers(self) -> bool:
        if self._topics is not None:
            return self._topics.has_publishers
        observed = (topics.ROBOT_POSE, topics.INTENT, topics.EPISODE)
        return any(map(self._node.count_publishers, observed))

    def _gather_ended(self, memory: LearnerMemory, *, unfinished: bool = False) -> None:
        try:
            self._gather(memory, unfinished=unfinished)
        except USER_ERRORS as error:
            self._refuse(str(error))
            return
        self._again = self._node.config.learn_on == "episode" and memory.unlearned

    def _gather(self, memory: LearnerMemory, *, unfinished: bool) -> TimedDecisions:
        gathered, decisions = memory.gather(unfinished=unfinished)
        self._save_decisions(gathered)
        self._node.get_logger().info(f"in this session {memory.drive.report}")
        return decisions

    def _on_learn(self, _: Trigger.Request) -> str:
        """Answers at once: this executor cannot hold an answer back until a fit has ended."""
        try:
            if self._memory is not None:
                require_enough(self._gather(self._memory, unfinished=True), self._node.config)
        except USER_ERRORS as error:
            self._refuse(str(error))
            raise NodeError(f"not learned: {error}") from None
        self._begin_anew = True
        when = "when the fit under way has ended" if self._worker.busy else "now"
        return f"learning begins {when}; progress and result are published on diagnostics"

    def _begin(self, *, anew: bool) -> None:
        self._again = self._begin_anew = False
        self._begun_s = self._node.wall_s()
        memory = self._memory
        if memory is None:
            self._worker.begin(
                lambda report: learn(self._task, self._read(), self._node.config, report)
            )
            return
        decisions, warm = memory.decisions, None if anew else memory.warm_weights
        if decisions is None:
            self._refuse("no episode has ended yet; demonstrate, then call again")
            return
        self._worker.begin(
            lambda report: learn(self._task, decisions, self._node.config, report, warm)
        )

    def _read(self) -> TimedDecisions:
        config, place = self._node.config, self._place
        decisions, report = demonstrations_of_bag(
            config.bag, place.grid, place.patience_s, place.wait_s, self._mapping_with_goal
        )
        text = f"{len(decisions)} decisions from {config.bag}: {report}"
        self._node.get_logger().info(text)
        write_progress(Progress(text=text))
        self._save_decisions(decisions)
        return until_goal(decisions, self._task.problem.goal_states)

    @property
    def _mapping_with_goal(self) -> BagMapping | None:
        scenario = self._place.scenario
        if self._mapping is None or scenario is None:
            return self._mapping
        return self._mapping.with_goal(scenario.goal_area_m)

    def _save_decisions(self, decisions: TimedDecisions) -> None:
        if self._node.config.decisions:
            save_learnable(Path(self._node.config.decisions), self._place, decisions)

    def _show(self, progress: FitProgress) -> None:
        step, wall_s = progress.step, self._node.wall_s()
        if self._memory is not None and wall_s >= self._checkpoint_due_s:
            self._checkpoint_due_s = wall_s + _CHECKPOINT_PERIOD_S
            self._memory.save_progress(progress)
        values = {
            "fit": progress.number,
            "fits": progress.total,
            "step": step.number,
            "objective_per_decision": step.objective,
            "gradient_norm": step.gradient_norm,
            "seconds": wall_s - self._begun_s,
        }
        self._node.report(0.0, values, message="learning")
        text = (
            f"step {step.number}: objective {step.objective:.4f} per decision, "
            f"gradient {step.gradient_norm:.1e}"
        )
        numbered = f"fit {progress.number} of {progress.total}, {text}"
        self._node.get_logger().info(numbered, throttle_duration_sec=1.0)
        write_progress(Progress(text=text, done=progress.number - 1))

    def _conclude(self, outcome: FitOutcome) -> None:
        save_outcome(Path(self._node.config.output), outcome, self._task.problem.grid)
        self._refusal = ""
        self._models.publish(String(data=model_yaml(outcome.model)))
        if self._memory is not None:
            self._memory.save_learned(outcome.fit)
        self._node.get_logger().info(outcome.summary())
        if outcome.traps.n_looping_cells:
            self._node.get_logger().warning(outcome.traps.sentence())
        values = {**outcome.values(), "model": self._node.config.output}
        level = OK if outcome.fit.converged else WARN
        self._node.report(0.0, values, level=level, message=outcome.fit.message)
        if self._memory is None:
            self._node.finish(0 if outcome.fit.converged else _UNCONVERGED)

    def _refuse(self, reason: str) -> None:
        """The model stays as it is."""
        if self._memory is None:
            self._node.fail(reason)
            return
        self._refusal = reason
        self._node.get_logger().warning(f"not learned: {reason}")
        self._node.report(0.0, {"model": self._node.config.output}, level=WARN, message=reason)
