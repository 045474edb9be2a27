"""What learning returns: the fit, its model file, how the fit went, and where it is trapped."""

from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from serd_app.learning.knowledge import DynamicsRow, Knowledge, save_knowledge
from serd_app.places.kept_scenario import keep_scenario, kept_scenario_file
from serd_bag.files import atomic_write_text, delete_file
from serd_core.arrays import FloatArray
from serd_core.arrival.arriving_policy import least_time_policy, trap_states
from serd_core.arrival.chain import goal_mask, policy_chain, probability_of_ever_arriving
from serd_core.demonstrations.decisions import Decisions, TimedDecisions
from serd_core.grid.grid import Grid
from serd_core.grid.navigation import NavigationProblem
from serd_core.learners.fit_result import FitResult
from serd_core.policies.solved_policy import optimal_policy
from serd_core.posterior.parameters import Parameters
from serd_core.semi_markov.models import require_timed
from serd_files.grid_file import save_grid
from serd_files.model_file import ModelFile
from serd_files.table import Column, csv_text, read_table, write_rows
from serd_files.yaml_config import save_yaml_model
from serd_sim.drivers.strategy import learned_dynamics


@dataclass(frozen=True)
class LearnedTraps:
    """Cells from which the actions of the learned policy never lead to the goal.

    n_looping_cells: of the n_reaching_cells, from which some policy reaches the goal among n_cells.
    n_looping_starts: of the n_starts cells in which the demonstrations begin.
    """

    n_looping_cells: int
    n_reaching_cells: int
    n_cells: int
    n_looping_starts: int
    n_starts: int

    def sentence(self) -> str:
        """The counts, and what the strategy does about them."""
        cut_off = self.n_cells - self.n_reaching_cells
        rest = f"; from {cut_off} further cells no policy does" if cut_off else ""
        if not self.n_looping_cells:
            return (
                f"the learned policy reaches the goal from all {self.n_reaching_cells} cells{rest}"
            )
        return (
            f"the learned policy never reaches the goal from {self.n_looping_cells} of"
            f" {self.n_reaching_cells} cells ({self.n_looping_cells / self.n_reaching_cells:.0%}),"
            f" {self.n_looping_starts} of the {self.n_starts} in which demonstrations begin among"
            f" them{rest}; a strategy takes the way of least expected time there"
        )


def learned_traps(
    problem: NavigationProblem, decisions: Decisions, weights: FloatArray, dynamics: FloatArray
) -> LearnedTraps:
    """Count them for the plan of the learned rewards and the mean of the dynamics, as it is driven.

    problem: its decisions take time. decisions: in states of the problem, as the fit learned from
    them. weights: (F,) of the rewards; dynamics: (n, N) draws of the parameters.
    """
    grid, model = problem.grid, require_timed(problem.mdp.transitions)
    table = model.local_probabilities(dynamics).mean(axis=0)
    greedy = optimal_policy(problem, weights, table).greedy
    outcomes = model.outcomes.local_probabilities(dynamics).mean(axis=0)
    seconds = np.mean([model.expected_seconds(each) for each in dynamics], axis=0)
    fastest = least_time_policy(problem, outcomes, seconds).probabilities
    chain = policy_chain(problem.by_decisions.mdp, fastest, outcomes)
    reaching = probability_of_ever_arriving(chain, goal_mask(problem)) > 0.5
    looping = trap_states(grid.neighbours, greedy, problem.goal_states) & reaching
    first = np.unique(decisions.episode, return_index=True)[1]
    starts = np.unique(decisions.state[first])
    return LearnedTraps(
        n_looping_cells=int(looping.sum()),
        n_reaching_cells=int(reaching.sum()),
        n_cells=grid.n_states,
        n_looping_starts=int(looping[starts].sum()),
        n_starts=len(starts),
    )


@dataclass(frozen=True, eq=False)
class FitOutcome:
    """A fit and the model file that keeps it.

    problem: what the method learned on: its decisions take time, or all the same. decisions: those
    that it learned from, of all that the recipe was given. durations: what
    was found about dwell times, in sentences. prior_weight: the weight it used, None for methods
    without; validation: log-likelihood per validation decision of each candidate weight, empty
    where none was chosen. knowledge: None where the fit has no posterior. scenario_yaml: see
    `LearningTask`. traps: from where the learned policy never arrives. both: counted dynamics and
    those learned with rewards, none where they were not compared.
    """

    fit: FitResult
    model: ModelFile
    traps: LearnedTraps
    problem: NavigationProblem
    decisions: TimedDecisions
    prior_weight: float | None = None
    validation: tuple[tuple[float, float], ...] = ()
    knowledge: Knowledge | None = None
    scenario_yaml: str = ""
    durations: tuple[str, ...] = ()
    both: tuple[DynamicsRow, ...] = ()

    def trace_table(self) -> str:
        """The objective after each step of the fit to all episodes, as CSV."""
        rows = enumerate(self.fit.objective_trace.tolist(), start=1)
        return csv_text(("step", "objective"), rows)

    def summary(self) -> str:
        """How the fit ended and what it found, in one line."""
        fit = self.fit
        pairs = zip(fit.feature_names, fit.reward_weights, strict=True)
        weights = ", ".join(f"{name} {weight:+.2f}" for name, weight in pairs)
        prior = "" if self.prior_weight is None else f", prior weight {self.prior_weight:g}"
        return (
            f"{self.model.method} {'converged' if fit.converged else 'did NOT converge'}"
            f" ({fit.message}){prior}; objective {fit.objective:.2f}; weights: {weights}"
        )

    def values(self) -> dict[str, object]:
        """The summary by name."""
        fit = self.fit
        found: dict[str, object] = {
            "method": self.model.method,
            "converged": fit.converged,
            "objective": fit.objective,
            "gradient_norm": fit.gradient_norm,
            "n_episodes": self.model.fit.n_episodes,
            "n_decisions": fit.n_decisions,
            "n_steps": fit.n_steps,
        }
        if self.prior_weight is not None:
            found["prior_weight"] = self.prior_weight
        found |= {f"weight.{name}": each for name, each in self.model.reward_weights.items()}
        found |= asdict(self.traps)
        if self.knowledge is not None:
            start = asdict(self.knowledge.next_start)
            found |= {f"next_{name}": each for name, each in start.items()}
        return found


def save_outcome(output: Path, outcome: FitOutcome, grid: Grid) -> None:
    """Write the model to `output`, and beside it grid, steps and precision of the fit.

    Its scenario is written as well, where that is not built in; first, as an edited file is not
    replaced.
    """
    files = outcome_files(output)
    keep_scenario(output, outcome.scenario_yaml)
    save_grid(files["grid"], grid, outcome.model.scenario)
    atomic_write_text(files["learning"], outcome.trace_table())
    for name in ("posterior", "durations", "weights", "gain", "gain_map"):
        delete_file(files[name])  # of an earlier fit
    write_rows(files["dynamics"], DynamicsRow, outcome.both)
    if outcome.knowledge is not None:
        save_knowledge(files, outcome.knowledge)
    save_yaml_model(files["model"], outcome.model)


def outcome_files(output: Path) -> dict[str, Path]:
    """The files beside a model, by what they hold; `serd learn` draws the map."""
    return {
        "model": output,
        "grid": output.with_suffix(".grid.yaml"),
        "scenario": kept_scenario_file(output),
        "learning": output.with_suffix(".learning.csv"),
        "dynamics": output.with_suffix(".dynamics.csv"),
        "posterior": output.with_suffix(".posterior.csv"),
        "durations": output.with_suffix(".durations.csv"),
        "weights": output.with_suffix(".weights.csv"),
        "gain": output.with_suffix(".next_demonstration.csv"),
        "gain_map": output.with_suffix(".next_demonstration.png"),
    }


def fit_of_file(model: ModelFile, problem: NavigationProblem, trace: FloatArray) -> FitResult:
    """The fit a model file keeps, with its objective after each step.

    problem: its decisions take time. Weights are those of the features that it has.
    """
    model = model.with_features(problem.feature_names)
    truth, belief = (
        learned_dynamics("the model", model, problem, believed=believed)
        for believed in (False, True)
    )
    record = model.fit.model_dump(exclude={"n_episodes"})
    return FitResult(
        feature_names=model.feature_names,
        outcome_probabilities=model.outcome_probabilities,
        believed_outcome_probabilities=model.believed_outcome_probabilities,
        initial_outcome_probabilities=model.initial_outcome_probabilities,
        temperature=model.temperature,
        parameters=Parameters(model.weights, belief, truth, np.zeros(0)),
        objective_trace=trace,
        residual=np.nan,
        error_bound=np.nan,
        assumptions=None,
        **record,
    )


def load_trace(path: Path) -> FloatArray:
    """(N,) the objective after each step, of the file beside a model."""
    columns = Column("step", int), Column("objective", float)
    return np.array([row["objective"] for row in read_table(path, columns)])
