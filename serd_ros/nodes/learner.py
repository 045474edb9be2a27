"""learner: turns a bag into decisions and decisions into a model file, as a ROS 2 node."""

import sys
from pathlib import Path

from std_srvs.srv import Trigger

from bags.discretise import decisions_from_bag
from bags.goal_entry import goal_entry_times_s
from serd_core.ascent.ascent import Step
from serd_core.demonstrations import Decisions
from serd_core.errors import SerdError
from serd_ros import topics
from serd_ros.configs import LearnerConfig
from serd_ros.errors import NodeError
from serd_ros.learning import Lesson, learn
from serd_ros.run_node import run_node
from serd_ros.serd_node import SerdNode
from sim.scenario import load_scenario
from sim.scenario_grid import grid_of
from storage.atomic import atomic_write_text
from storage.decision_table import save_decisions
from storage.grid_file import save_grid
from storage.model_file import save_model

_TELL_EVERY = 10
_UNCONVERGED = 1


class LearnerNode(SerdNode[LearnerConfig]):
    """Learns at start when a bag is given, and again whenever `learn` is called."""

    def __init__(self) -> None:
        super().__init__("learner", LearnerConfig)
        self._scenario = load_scenario(self.config.scenario)
        self.create_service(Trigger, topics.LEARN, self._on_learn)
        if self.config.bag:
            self._start = self.create_timer(0.0, self._learn_at_start, clock=self.wall_clock)
        elif self.config.exit_when_done:
            raise NodeError("bag must be given when exit_when_done is true; add -p bag:=FOLDER")

    def _learn_at_start(self) -> None:
        self._start.cancel()
        lesson = self._learn()
        if self.config.exit_when_done:
            self.finish(0 if lesson.fit.converged else _UNCONVERGED)

    def _on_learn(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        try:
            lesson = self._learn()
        except SerdError as error:
            response.success, response.message = False, str(error)
            return response
        response.success, response.message = lesson.fit.converged, lesson.fit.message
        return response

    def _learn(self) -> Lesson:
        decisions = self._read()
        entry_s = goal_entry_times_s(
            self.config.bag, decisions, self._scenario.decision_period_s
        ).tolist()
        lesson = learn(self._scenario, decisions, self.config, self._tell, entry_s)
        output = Path(self.config.output)
        save_model(output, lesson.model)
        save_grid(output.with_name("grid.yaml"), grid_of(self._scenario), self._scenario.name)
        atomic_write_text(output.with_name("learning.csv"), lesson.trace_table())
        self._conclude(lesson)
        return lesson

    def _read(self) -> Decisions:
        decisions, report = decisions_from_bag(
            Path(self.config.bag), grid_of(self._scenario), self._scenario.decision_period_s
        )
        self.get_logger().info(f"{len(decisions)} decisions from {self.config.bag}: {report}")
        if self.config.decisions:
            save_decisions(self.config.decisions, decisions)
        return decisions

    def _tell(self, start: int, step: Step) -> None:
        if step.number % _TELL_EVERY == 0:
            self.get_logger().info(
                f"start {start + 1} of {self.config.starts}, step {step.number}: "
                f"objective {step.objective:.4f} per decision, gradient {step.gradient_norm:.1e}"
            )

    def _conclude(self, lesson: Lesson) -> None:
        fit = lesson.fit
        weights = ", ".join(
            f"{name} {weight:+.2f}"
            for name, weight in zip(fit.feature_names, fit.reward_weights, strict=True)
        )
        spread = max(lesson.objectives) - min(lesson.objectives)
        self.get_logger().info(
            f"{'converged' if fit.converged else 'NOT converged'} ({fit.message}); log posterior "
            f"{fit.objective:.2f}, starts differ by {spread:.2g}; weights: {weights}"
        )
        self.report(
            0.0,
            {
                "converged": fit.converged,
                "objective": fit.objective,
                "gradient_norm": fit.gradient_norm,
                "n_decisions": fit.n_decisions,
                "n_steps": fit.n_steps,
                "model": self.config.output,
            },
            message=fit.message,
        )


def main() -> int:
    """Entry point of `ros2 run serd_ros learner`."""
    return run_node(LearnerNode)


if __name__ == "__main__":
    sys.exit(main())
