"""The learned model as one YAML file people can read: rewards, outcome models, how it was fitted.

Outcome models are rows P_m(k) over the outcomes of a decision period (Table 5.1).
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, SerializerFunctionWrapHandler, model_serializer, model_validator

from serd_bag.errors import FileError
from serd_core.arrays import FloatArray, IntArray
from serd_core.arrival.crossing_chain import Kind
from serd_core.bayes.draws import PosteriorDraws
from serd_core.grid.grid import Grid, Outcome
from serd_core.grid.navigation import MODEL_NAMES, WAITING, NavigationProblem
from serd_core.learners.fit_result import FitResult
from serd_files.grid_file import BLOCKED, WALKABLE, flow_of_picture, flow_picture
from serd_files.yaml_config import StrictModel, load_yaml_model

_SUM_TOLERANCE = 1e-6
Probabilities = tuple[Annotated[float, Field(ge=0, le=1)], ...]


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
    """One local model: the learned one, the expert's belief, and the initial estimate."""

    name: str
    learned: Probabilities
    believed: Probabilities
    initial: Probabilities


class ModelDraws(StrictModel):
    """Draws of the posterior: what the demonstrations leave open.

    reward_weights: a row of weights per draw; learned: per draw a row per outcome model.
    """

    reward_weights: tuple[tuple[float, ...], ...] = ()
    learned: tuple[tuple[Probabilities, ...], ...] = ()


#: Of mean times in cells.
CROSSING_COVARIATES = (
    "intercept", "against_flow", "across_flow", "turning", "first", "people_pm2",
)  # fmt: skip
_Count = Annotated[int, Field(ge=0)]


class CrossingTimes(StrictModel):
    """How long a robot that drives with a look-ahead takes to leave a cell (docs/arrival.md).

    coefficients: of the logarithm of the mean (s), by covariate, people_pm2 counted from
    mean_people_pm2; dispersion: squared coefficient of variation by kind of move; pace_variance: of
    a drive's logarithm. people_pm2: lowest and highest people per m² of the drives. left_towards:
    by flow of an action, how often the cell was left forward, right, back and left of it.
    not_seen: flows and kinds of moves without crossings.
    """

    lookahead_cells: int = Field(ge=1)
    coefficients: dict[str, float]
    dispersion: dict[str, Annotated[float, Field(gt=0)]]
    pace_variance: float = Field(gt=0)
    people_pm2: tuple[float, float]
    mean_people_pm2: float = Field(ge=0)
    left_towards: dict[str, tuple[_Count, _Count, _Count, _Count]]
    not_seen: tuple[str, ...] = ()
    n_crossings: int = Field(ge=1)
    n_episodes: int = Field(ge=1)

    @model_validator(mode="after")
    def _complete(self) -> "CrossingTimes":
        for name, wanted in (
            ("coefficients", CROSSING_COVARIATES),
            ("dispersion", tuple(kind.value for kind in Kind)),
            ("left_towards", MODEL_NAMES[:WAITING]),
        ):
            found = getattr(self, name)
            if set(found) != set(wanted):
                raise ValueError(f"{name} must have {', '.join(wanted)}, got {', '.join(found)}")
        if not 0 <= self.people_pm2[0] <= self.people_pm2[1]:
            raise ValueError(f"people_pm2 must ascend from at least 0, got {self.people_pm2}")
        return self


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


class ModelFile(StrictModel):
    """Everything the strategy needs from a fit, and a summary of the fit for people.

    flow: picture of the direction people walk in per cell, as `serd_files.grid_file` has it;
    none where it is that of the scenario.
    draws: none where the fit has no posterior.
    goals_m: centres of the goal cells.
    goal_entry_s: how long after the beginning of its last decision period each demonstration was in
    the goal area; none where that was not recorded.
    crossing_times: of drives, one per look-ahead; without, and then not in the file, arrivals are
    predicted by decision periods.
    """

    format: Literal["serd-model"] = "serd-model"
    format_version: Literal[1] = 1
    scenario: str
    method: str
    prior: str
    discount: float = Field(ge=0, lt=1)
    beta: float = Field(gt=0)
    decision_period_s: float = Field(gt=0)
    reward_weights: dict[str, float]
    temperature: float = Field(default=1.0, gt=0)
    outcome_names: tuple[str, ...]
    outcome_models: tuple[OutcomeModel, ...] = Field(min_length=1)
    grid: GridSummary
    flow: tuple[str, ...] = ()
    goals_m: tuple[tuple[float, float], ...] = ()
    goal_entry_s: tuple[Annotated[float, Field(gt=0)], ...] = ()
    fit: FitRecord
    draws: ModelDraws = ModelDraws()
    crossing_times: tuple[CrossingTimes, ...] = ()

    @model_serializer(mode="wrap")
    def _without_no_times(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        values: dict[str, Any] = handler(self)
        if not self.crossing_times:
            values.pop("crossing_times", None)
        return values

    @model_validator(mode="after")
    def _one_per_lookahead(self) -> "ModelFile":
        cells = [each.lookahead_cells for each in self.crossing_times]
        if len(set(cells)) < len(cells):
            raise ValueError(f"crossing_times must have each lookahead_cells once, got {cells}")
        return self

    @model_validator(mode="after")
    def _known_models(self) -> "ModelFile":
        for model in self.outcome_models:
            if model.name not in MODEL_NAMES:
                raise ValueError(
                    f"outcome_models must be among {', '.join(MODEL_NAMES)}, got {model.name!r};"
                    " learn the model again (models whose outcomes depend on density have left)"
                )
        return self

    @model_validator(mode="after")
    def _rows_are_distributions(self) -> "ModelFile":
        for model in self.outcome_models:
            for kind in ("learned", "believed", "initial"):
                _require_distribution(f"{model.name}.{kind}", getattr(model, kind), self)
        return self

    @model_validator(mode="after")
    def _draws_fit(self) -> "ModelFile":
        if len(self.draws.reward_weights) != len(self.draws.learned):
            raise ValueError("draws must have as many reward_weights as learned tables")
        if any(len(row) != len(self.reward_weights) for row in self.draws.reward_weights):
            raise ValueError("draws.reward_weights must have a weight per feature")
        for number, table in enumerate(self.draws.learned):
            if len(table) != len(self.outcome_models):
                raise ValueError("draws.learned must have a row per outcome model")
            for row in table:
                _require_distribution(f"draws.learned {number}", row, self)
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

    def times_of(self, lookahead_cells: int) -> CrossingTimes | None:
        """The crossing times of a look-ahead; None where none are known."""
        found = (each for each in self.crossing_times if each.lookahead_cells == lookahead_cells)
        return next(found, None)

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


def model_of_fit(
    fit: FitResult,
    problem: NavigationProblem,
    *,
    scenario: str,
    method: str,
    prior: str,
    decision_period_s: float,
    n_episodes: int,
    goal_entry_s: Sequence[float] = (),
    own_flow: bool = False,
    draws: PosteriorDraws | None = None,
) -> ModelFile:
    """The fit of a navigation problem as a model file.

    own_flow: whether the problem's flow is stored as well, because it is not the scenario's.
    """
    tables = (
        fit.outcome_probabilities,
        fit.believed_outcome_probabilities,
        fit.initial_outcome_probabilities,
    )
    rows = zip(problem.model_names, *(table.tolist() for table in tables), strict=True)
    kept = ModelDraws()
    if draws is not None:
        learned = draws.outcome_probabilities.tolist()
        drawn = {"reward_weights": draws.reward.tolist(), "learned": learned}
        kept = ModelDraws.model_validate(drawn)
    values = {name: getattr(fit, name) for name in FitRecord.model_fields if name != "n_episodes"}
    return ModelFile(
        scenario=scenario,
        method=method,
        prior=prior,
        discount=problem.mdp.discount,
        beta=problem.outcome_models.beta,
        decision_period_s=decision_period_s,
        reward_weights=dict(zip(fit.feature_names, fit.reward_weights.tolist(), strict=True)),
        temperature=fit.temperature,
        outcome_names=tuple(outcome.name.lower() for outcome in Outcome),
        outcome_models=tuple(
            OutcomeModel(name=name, learned=learned, believed=believed, initial=initial)
            for name, learned, believed, initial in rows
        ),
        grid=GridSummary.of(problem.grid),
        flow=flow_picture(problem.grid, problem.flow) if own_flow else (),
        goals_m=tuple((float(x), float(y)) for x, y in problem.grid.centers_m[problem.goal_states]),
        goal_entry_s=tuple(float(entry_s) for entry_s in goal_entry_s),
        fit=FitRecord(n_episodes=n_episodes, **values),
        draws=kept,
    )


def load_model(path: str | Path, *, expected_grid: Grid | None = None) -> ModelFile:
    """Read a model; FileError names the differences where it was made for another grid."""
    model = load_yaml_model(path, ModelFile)
    if expected_grid is not None:
        require_grid(path, model, expected_grid)
    return model


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
