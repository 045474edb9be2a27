"""The learned model as one YAML file people can read: rewards, outcome models, how it was fitted.

Outcome models are rows P_m(k) over the outcomes of a decision (Table 5.1), each with the gamma law
of how long a decision takes that leads to another cell (docs/semi_markov.md).
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from serd_bag.errors import FileError
from serd_core.arrays import FloatArray, IntArray
from serd_core.grid.grid import Grid, Outcome
from serd_core.grid.navigation import MODEL_NAMES, WAITING, NavigationProblem
from serd_core.learners.fit_result import FitResult
from serd_core.semi_markov.models import NO_LAW, SemiMarkovModels, require_timed
from serd_files.grid_file import BLOCKED, WALKABLE, flow_of_picture, flow_picture
from serd_files.yaml_config import StrictModel, load_yaml_model

_SUM_TOLERANCE = 1e-6
Probabilities = tuple[Annotated[float, Field(ge=0, le=1)], ...]
Positive = Annotated[float, Field(gt=0)]


class GridSummary(StrictModel):
    """What identifies the grid of the model, for the message where another grid is used."""

    fingerprint: str
    origin_m: tuple[float, float]
    cell_size_m: float
    rows: int
    columns: int
    n_states: int

    @classmethod
    def of(cls, grid: Grid) -> "GridSummary":
        """The summary of a grid."""
        rows, columns = grid.walkable.shape
        return cls(
            fingerprint=grid.fingerprint(),
            origin_m=grid.origin_m,
            cell_size_m=grid.cell_size_m,
            rows=rows,
            columns=columns,
            n_states=grid.n_states,
        )


class OutcomeModel(StrictModel):
    """One local model: the learned one, the expert's belief, and the initial estimate.

    mean_s, shape: of the gamma law of dwell times, believed_mean_s: the mean that the expert
    expects. Without a shape each decision takes mean_s.
    """

    name: str
    learned: Probabilities
    believed: Probabilities
    initial: Probabilities
    mean_s: Positive
    believed_mean_s: Positive
    shape: Positive | None = None


class ModelDraws(StrictModel):
    """Draws of the posterior: what the demonstrations leave open.

    reward_weights: a row of weights per draw; learned: per draw a row per outcome model; mean_s,
    shape: per draw a number per outcome model that has a shape.
    """

    reward_weights: tuple[tuple[float, ...], ...] = ()
    learned: tuple[tuple[Probabilities, ...], ...] = ()
    mean_s: tuple[tuple[Positive, ...], ...] = ()
    shape: tuple[tuple[Positive, ...], ...] = ()


class FitRecord(StrictModel):
    """How the fit went; the fields of `FitResult`."""

    converged: bool
    message: str
    n_episodes: int
    n_decisions: int
    objective: float
    policy_log_likelihood: float
    dynamics_log_likelihood: float
    hidden_log_likelihood: float = 0.0
    log_prior: float
    gradient_norm: float
    n_steps: int
    n_evaluations: int


class Check(StrictModel):
    """Whether the data support a claim of the model; sentence: what was tested, with numbers.

    key: of the question (`serd_app.learning.criticism`).
    """

    key: str
    mark: Literal["holds", "fails", "unknown"]
    sentence: str


class FeatureRecord(StrictModel):
    """A feature of the reward, or why it takes no part.

    values: of an own feature in each cell, in the order of the states.
    """

    name: str
    left_out: str = ""
    values: tuple[float, ...] = ()


class ModelFile(StrictModel):
    """Everything the strategy needs from a fit, and a summary of the fit for people.

    flow: picture of the direction people walk in per cell, as `serd_files.grid_file` has it;
    none where it is that of the scenario.
    draws: none where the fit has no posterior.
    goals_m: centres of the goal cells.
    discount: of a second. patience_s: after which a decision that led nowhere ended.
    pace: multiplier of dwell times in each cell, in the order of the states; none where places do
    not differ.
    checks: of the claims of the model by its data, none where it was not tested. features: what is
    known of them, also of those that take no part.
    """

    remade_by: ClassVar[str] = "run 'serd demos' and then 'serd learn' again"
    format: Literal["serd-model"] = "serd-model"
    format_version: Literal[2] = 2
    scenario: str
    method: str
    prior: str
    discount: float = Field(ge=0, lt=1)
    beta: float = Field(gt=0)
    patience_s: Positive
    reward_weights: dict[str, float]
    temperature: float = Field(default=1.0, gt=0)
    outcome_names: tuple[str, ...]
    outcome_models: tuple[OutcomeModel, ...] = Field(min_length=1)
    grid: GridSummary
    flow: tuple[str, ...] = ()
    goals_m: tuple[tuple[float, float], ...] = ()
    pace: tuple[Positive, ...] = ()
    fit: FitRecord
    draws: ModelDraws = ModelDraws()
    checks: tuple[Check, ...] = ()
    features: tuple[FeatureRecord, ...] = ()

    @model_validator(mode="after")
    def _models_fit(self) -> "ModelFile":
        for model in self.outcome_models:
            if model.name not in MODEL_NAMES:
                raise ValueError(
                    f"outcome_models must be among {', '.join(MODEL_NAMES)}, got {model.name!r};"
                    " learn the model again"
                )
        names = [model.name for model in self.outcome_models]
        if len(set(names)) < len(names) or MODEL_NAMES[WAITING] not in names:
            raise ValueError(
                f"outcome_models must hold each name once and {MODEL_NAMES[WAITING]!r}, got"
                f" {', '.join(names)}; learn the model again"
            )
        for model in self.outcome_models:
            for kind in ("learned", "believed", "initial"):
                _require_distribution(f"{model.name}.{kind}", getattr(model, kind), self)
        return self

    @model_validator(mode="after")
    def _draws_fit(self) -> "ModelFile":
        sizes = {len(getattr(self.draws, name)) for name in ModelDraws.model_fields}
        if len(sizes) > 1:
            raise ValueError("draws must have as many reward_weights as learned, mean_s and shape")
        if any(len(row) != len(self.reward_weights) for row in self.draws.reward_weights):
            raise ValueError("draws.reward_weights must have a weight per feature")
        for number, table in enumerate(self.draws.learned):
            if len(table) != len(self.outcome_models):
                raise ValueError("draws.learned must have a row per outcome model")
            for row in table:
                _require_distribution(f"draws.learned {number}", row, self)
        n_laws = sum(each.shape is not None for each in self.outcome_models)
        if any(len(row) != n_laws for row in (*self.draws.mean_s, *self.draws.shape)):
            raise ValueError("draws.mean_s and draws.shape must have a number per law")
        if self.pace and len(self.pace) != self.grid.n_states:
            raise ValueError(f"pace must have a number per cell ({self.grid.n_states})")
        return self

    def with_features(self, names: Sequence[str]) -> "ModelFile":
        """The model without the weights of all features but the named ones."""
        kept = [row for row, name in enumerate(self.feature_names) if name in names]
        if len(kept) == len(self.feature_names):
            return self
        chosen = {name: weight for name, weight in self.reward_weights.items() if name in names}
        drawn = tuple(tuple(row[column] for column in kept) for row in self.draws.reward_weights)
        draws = self.draws.model_copy(update={"reward_weights": drawn})
        return self.model_copy(update={"reward_weights": chosen, "draws": draws})

    @property
    def own_features(self) -> dict[str, FloatArray]:
        """(S,) values of each own feature, in the states of its grid."""
        return {each.name: np.array(each.values) for each in self.features if each.values}

    def flow_on(self, path: str | Path, grid: Grid) -> IntArray | None:
        """(S,) its own flow on the grid it is for; None where that is the scenario's."""
        if not self.flow:
            return None
        flow = flow_of_picture(self.flow, grid)
        if flow is None:
            raise FileError(
                f"{path}: flow must be a picture of its grid in ^ > v < . and #, got"
                f" {self.flow[0]!r} as the northernmost row; learn the model again"
            )
        return flow

    @property
    def wait_s(self) -> float:
        """Length of a wait, which is that of the model of waiting."""
        return next(m.mean_s for m in self.outcome_models if m.name == MODEL_NAMES[WAITING])

    @property
    def without_flow(self) -> bool:
        """Whether it was learned in a place without flow, as far as the file has the flow."""
        return bool(self.flow) and set("".join(self.flow)) <= {WALKABLE, BLOCKED}

    @property
    def feature_names(self) -> tuple[str, ...]:
        """Names in the order of `weights`."""
        return tuple(self.reward_weights)

    @property
    def weights(self) -> FloatArray:
        """(F,) reward weights."""
        return np.array(list(self.reward_weights.values()))

    @property
    def outcome_probabilities(self) -> FloatArray:
        """(M, K) learned outcome models of the world."""
        return np.array([model.learned for model in self.outcome_models])

    @property
    def believed_outcome_probabilities(self) -> FloatArray:
        """(M, K) outcome models the expert believed in; policies are made from these."""
        return np.array([model.believed for model in self.outcome_models])

    @property
    def initial_outcome_probabilities(self) -> FloatArray:
        """(M, K) estimate from the transitions alone."""
        return np.array([model.initial for model in self.outcome_models])


@dataclass(frozen=True, eq=False)
class LearnedDynamics:
    """truth, belief: (N,) parameters of `SemiMarkovModels`; log_pace: (S,) of the places.

    draws: (n, N) of the truth and reward_draws: (n, F), None without a posterior.
    """

    truth: FloatArray
    belief: FloatArray
    log_pace: FloatArray
    draws: FloatArray | None = None
    reward_draws: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))


def model_of_fit(
    fit: FitResult,
    problem: NavigationProblem,
    *,
    scenario: str,
    method: str,
    prior: str,
    n_episodes: int,
    dynamics: LearnedDynamics,
    own_flow: bool = False,
) -> ModelFile:
    """The fit of a navigation problem, whose decisions take time, as a model file.

    own_flow: whether the problem's flow is stored as well, because it is not the scenario's.
    """
    models = require_timed(problem.mdp.transitions)
    tables = (
        fit.outcome_probabilities,
        fit.believed_outcome_probabilities,
        fit.initial_outcome_probabilities,
    )
    rows = zip(*(table.tolist() for table in tables), strict=True)
    values = {name: getattr(fit, name) for name in FitRecord.model_fields if name != "n_episodes"}
    return ModelFile(
        scenario=scenario,
        method=method,
        prior=prior,
        discount=problem.mdp.discount,
        beta=problem.outcome_models.beta,
        patience_s=models.stay_s[0],
        reward_weights=dict(zip(fit.feature_names, fit.reward_weights.tolist(), strict=True)),
        temperature=fit.temperature,
        outcome_names=tuple(outcome.name.lower() for outcome in Outcome),
        outcome_models=tuple(
            OutcomeModel(
                name=problem.model_names[m],
                learned=learned,
                believed=believed,
                initial=initial,
                **_law(models, m, dynamics),
            )
            for m, (learned, believed, initial) in enumerate(rows)
        ),
        grid=GridSummary.of(problem.grid),
        flow=flow_picture(problem.grid, problem.flow) if own_flow else (),
        goals_m=tuple((float(x), float(y)) for x, y in problem.grid.centers_m[problem.goal_states]),
        pace=tuple(np.exp(dynamics.log_pace).tolist()) if dynamics.log_pace.any() else (),
        fit=FitRecord(n_episodes=n_episodes, **values),
        draws=ModelDraws()
        if dynamics.draws is None
        else ModelDraws.model_validate(
            {
                "reward_weights": dynamics.reward_draws.tolist(),
                "learned": models.outcomes.local_probabilities(dynamics.draws).tolist(),
                "mean_s": np.exp(dynamics.draws[:, models.means]).tolist(),
                "shape": np.exp(dynamics.draws[:, models.shapes]).tolist(),
            }
        ),
    )


def _law(models: SemiMarkovModels, m: int, dynamics: LearnedDynamics) -> dict[str, float]:
    law = int(models.law_of[m, 0])
    if law == NO_LAW:
        return {"mean_s": float(models.stay_s[m]), "believed_mean_s": float(models.stay_s[m])}
    mean, shape = models.means.start + law, models.shapes.start + law
    return {
        "mean_s": float(np.exp(dynamics.truth[mean])),
        "believed_mean_s": float(np.exp(dynamics.belief[mean])),
        "shape": float(np.exp(dynamics.truth[shape])),
    }


def load_model(path: str | Path) -> ModelFile:
    """Read a model; FileError where it is none."""
    return load_yaml_model(path, ModelFile)


def require_grid(path: str | Path, model: ModelFile, grid: Grid) -> None:
    """FileError with the differences where the model of a file was made for another grid."""
    here = GridSummary.of(grid)
    if model.grid.fingerprint != here.fingerprint:
        raise FileError(
            f"{path}: was made for another grid of the scenario {model.scenario!r}: "
            f"{_difference(model.grid, here)}"
            "; learn a model on this grid or choose the scenario the model was made for"
        )


def _difference(own: GridSummary, here: GridSummary) -> str:
    names = ("cell_size_m", "origin_m", "rows", "columns", "n_states")
    different = [name for name in names if getattr(own, name) != getattr(here, name)]
    if not different:
        return "same size, but other cells are walkable"
    parts = (f"{name} {getattr(own, name)} there, {getattr(here, name)} here" for name in different)
    return ", ".join(parts)


def _require_distribution(key: str, row: Probabilities, model: ModelFile) -> None:
    if len(row) != len(model.outcome_names):
        raise ValueError(
            f"outcome_models {key} must have one probability per outcome"
            f" ({len(model.outcome_names)}), got {len(row)}"
        )
    if abs(sum(row) - 1.0) > _SUM_TOLERANCE:
        raise ValueError(f"outcome_models {key} must sum to 1, got {sum(row)}")
