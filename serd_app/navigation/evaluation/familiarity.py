"""How usual trajectories are for a learned model: episodes ranked among simulated ones.

Trajectories are a table of decisions with the files beside it, or what `serd demos` reads, which is
then put on the grid of the model.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from serd_app.demonstrations.discretise import joined_reports
from serd_app.demonstrations.flow_field import FlowField
from serd_app.demonstrations.recorded import (
    Place,
    demonstrations_of_all,
    files_beside,
    read_recordings,
    save_demonstrations,
)
from serd_app.drives.mapping import DriveMapping
from serd_app.errors import AppError
from serd_app.learning.learning_files import LearningFiles, read_learning_files
from serd_app.learning.outcome import outcome_files
from serd_app.places.kept_scenario import scenario_beside
from serd_bag.quantities import counted
from serd_core.arrays import BoolArray, FloatArray
from serd_core.grid.grid import Grid
from serd_core.grid.navigation import NavigationProblem
from serd_core.policies.solved_policy import boltzmann_policy, soft_policy
from serd_core.selection.surprise import EpisodeScores, episode_scores, tail_probabilities
from serd_core.semi_markov.models import require_timed
from serd_core.semi_markov.timed_decisions import TimedDecisions
from serd_files.files import require_beside
from serd_files.grid_file import load_grid
from serd_files.model_file import ModelFile, load_model
from serd_sim.drivers.strategy import learned_dynamics, model_in_flow, require_same_scale
from serd_sim.scenario.scenario import load_scenario

_MOST_ASSUMED = 5
#: Decisions of a lower tail probability are surprising, episodes of a lower rank unusual.
SURPRISING, UNUSUAL = 0.01, 0.05
#: Methods whose policy is Boltzmann over optimal values.
_OF_OPTIMAL_VALUES = ("pm_serd", "policy_matching")


@dataclass(frozen=True)
class ScoredEpisode:
    """log_likelihood, simulated: means per decision, rank: 0 to 1, surprising: number of decisions.

    log_likelihood: None where the model rules out a decision.
    """

    episode: int
    decisions: int
    log_likelihood: float | None
    simulated: float | None
    rank: float
    surprising: int


@dataclass(frozen=True, eq=False)
class Familiarity:
    """files: of the recording; decisions: (N,) up to the goal, with their outcome; tails: (N,)
    probabilities of these; scores: of the episodes.

    discretised: what became of the recording, empty for a table of decisions.
    """

    files: LearningFiles
    decisions: TimedDecisions
    tails: FloatArray
    scores: EpisodeScores
    discretised: str

    @property
    def problem(self) -> NavigationProblem:
        """In which they were scored."""
        return self.files.task.problem

    @cached_property
    def surprising(self) -> BoolArray:
        """(N,) decisions with a low tail probability."""
        return np.asarray(self.tails < SURPRISING)

    @cached_property
    def episodes(self) -> tuple[ScoredEpisode, ...]:
        """Every episode, the least likely one among simulated ones first."""
        scores, of_decision = self.scores, self.decisions.episode
        found = (
            ScoredEpisode(
                int(episode),
                int(scores.n_decisions[row]),
                _finite(scores.log_likelihood[row]),
                _finite(scores.expected[row]),
                float(scores.rank[row]),
                int(self.surprising[of_decision == episode].sum()),
            )
            for row, episode in enumerate(scores.episode)
        )
        return tuple(sorted(found, key=lambda one: one.rank))

    def as_json(self) -> dict[str, object]:
        """Numbers over all episodes; log_likelihood is None where a decision is ruled out."""
        scores, files = self.scores, self.files
        weights = scores.n_decisions / scores.n_decisions.sum()
        return {
            "n_episodes": len(scores.episode),
            "n_decisions": len(self.decisions),
            "n_hidden": int(self.decisions.hidden.sum()),
            "n_after_goal": files.n_after_goal,
            "n_elsewhere": files.n_elsewhere,
            "n_episodes_left_out": files.n_left_out,
            "log_likelihood": _finite(weights @ scores.log_likelihood),
            "simulated": _finite(weights @ scores.expected),
            "mean_rank": float(scores.rank.mean()),
            "n_unusual": int(np.sum(scores.rank < UNUSUAL)),
            "n_surprising": int(self.surprising.sum()),
            "discretised": self.discretised,
        }

    def sentence(self) -> str:
        """The numbers over all episodes, and what was left out."""
        found, files = self.as_json(), self.files
        score, simulated = (
            "-inf" if found[name] is None else f"{found[name]:.3f}"
            for name in ("log_likelihood", "simulated")
        )
        left_out = f"; decisions left out: {files.left_out()}" if files.left_out() else ""
        if files.n_left_out:
            elsewhere = " or end elsewhere" if files.n_elsewhere else ""
            left_out += f"; episodes left out: {files.n_left_out} that begin in the goal{elsewhere}"
        on_grid = f"; on the grid of the model: {self.discretised}" if self.discretised else ""
        return (
            f"{counted(len(self.scores.episode), 'episode')},"
            f" {counted(len(self.decisions), 'decision')} ({found['n_hidden']} without action):"
            f" log-likelihood per decision {score}, of simulated episodes {simulated}; mean rank"
            f" {found['mean_rank']:.2f}, below {UNUSUAL:g}: {found['n_unusual']}; surprising"
            f" decisions: {found['n_surprising']}{left_out}{on_grid}"
        )


def familiarity_of(
    model: Path,
    trajectories: Sequence[Path],
    *,
    mapping: DriveMapping | None = None,
    scenario: str = "",
) -> Familiarity:
    """Score trajectories by the policy and dynamics of a model file.

    trajectories: a table of decisions, or bags or tables of trajectories of one place.
    scenario: name or file, in place of the one that the decisions or else the model name. FileError
    where cells are not as long as those of the model.
    """
    file = load_model(model)
    files, discretised = _files(model, file, trajectories, mapping, scenario)
    task, decisions = files.task, files.decisions
    decisions = decisions.select(~decisions.censored)  # of which no outcome is known
    grid = task.problem.grid
    require_same_scale(model, file, trajectories[0], grid.cell_size_m)
    if not len(decisions):
        raise AppError(
            f"{_in_words(trajectories)} must hold a decision before the goal of the model, got"
            " none; give others"
        )
    policy, outcomes = _policy(model, file, task.problem)
    problem = task.problem.by_decisions
    scores = episode_scores(problem, decisions, policy, outcomes, rng=np.random.default_rng(0))
    tails = tail_probabilities(problem, decisions, policy, outcomes)
    return Familiarity(files, decisions, tails, scores, discretised)


def _policy(
    model: Path, file: ModelFile, problem: NavigationProblem
) -> tuple[FloatArray, FloatArray]:
    """(S, A) policy and (M, K) true outcome probabilities of a model on a problem.

    A feature of the problem that the model does not have, as the social norm of one that was
    learned without flow, has no weight.
    """
    weights_of = model_in_flow(file, problem.flow).reward_weights
    weights = np.array([weights_of.get(name, 0.0) for name in problem.feature_names])
    timed = require_timed(problem.mdp.transitions)
    learned = learned_dynamics(model, file, problem)
    believed = timed.local_probabilities(learned_dynamics(model, file, problem, believed=True))
    outcomes = timed.outcomes.local_probabilities(learned)
    if file.method in _OF_OPTIMAL_VALUES:
        policy = boltzmann_policy(problem, weights, believed, file.temperature)
    else:
        policy = soft_policy(problem, weights, believed)
    return policy.probabilities, outcomes


def _files(
    model: Path,
    file: ModelFile,
    trajectories: Sequence[Path],
    mapping: DriveMapping | None,
    scenario: str,
) -> tuple[LearningFiles, str]:
    tables = [each for each in trajectories if files_beside(each)["record"].exists()]
    if tables and mapping is not None:
        raise AppError(
            f"--mapping must be left out for a table of decisions, got one for {tables[0]}"
        )
    if tables and len(trajectories) > 1:
        raise AppError(
            f"a table of decisions must be compared alone, got {tables[0]} with others; give the"
            " recordings that it is of"
        )
    if tables:
        own = load_grid(files_beside(tables[0])["grid"]).fingerprint() == file.grid.fingerprint
        goals = tuple(file.goals_m) if own else ()
        return _read(tables[0], file, scenario, goals), ""
    with TemporaryDirectory() as folder:
        table, place = Path(folder) / "decisions.csv", scenario
        if file.scenario and not scenario:
            place = scenario_beside(model, file.scenario)
        discretised = _discretise(model, file, trajectories, mapping, place, table)
        return _read(table, file, place, tuple(file.goals_m)), discretised


def _read(
    table: Path, file: ModelFile, scenario: str, goals_m: tuple[tuple[float, float], ...]
) -> LearningFiles:
    return read_learning_files(table, discount=file.discount, scenario=scenario, goals_m=goals_m)


def _discretise(
    model: Path,
    file: ModelFile,
    trajectories: Sequence[Path],
    mapping: DriveMapping | None,
    scenario: str,
    table: Path,
) -> str:
    """Write decisions on the model's grid, with the people of the recording or the model's flow."""
    require_beside(model, outcome_files(model)["grid"])
    grid = load_grid(outcome_files(model)["grid"])
    known = load_scenario(scenario) if scenario else None
    place = Place(grid, file.patience_s, file.wait_s, known)
    recordings = read_recordings(trajectories, mapping=mapping, scenario=place.scenario)
    found = demonstrations_of_all(recordings.all, grid, file.patience_s, file.wait_s)
    report = joined_reports([each.report for each in found])
    if not report.n_decisions:
        raise AppError(
            f"{_in_words(trajectories)} holds no decision on the grid of {model}: {report}; is it"
            " of the same place?"
        )
    flow = recordings.flow(grid)
    save_demonstrations(table, place, found, flow or _flow_of_model(model, file, grid))
    assumed = list(dict.fromkeys(line for each in recordings.all for line in each.assumed))
    more = [f"and {len(assumed) - _MOST_ASSUMED} more"] if len(assumed) > _MOST_ASSUMED else []
    return "; ".join([str(report), *assumed[:_MOST_ASSUMED], *more])


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _in_words(paths: Sequence[Path]) -> str:
    return str(paths[0]) if len(paths) == 1 else f"{paths[0]} and {len(paths) - 1} more"


def _flow_of_model(model: Path, file: ModelFile, grid: Grid) -> FlowField | None:
    flow = file.flow_on(model, grid)
    if flow is None:
        return None
    n_states = grid.n_states
    return FlowField(
        flow, np.zeros((n_states, 2)), np.zeros(n_states), np.zeros(n_states, dtype=np.int64)
    )
