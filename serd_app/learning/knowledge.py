"""What a fit knows: standard errors, precision of each outcome model and law of dwell times, its
source, and what demonstration would add most.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from itertools import groupby
from pathlib import Path

import numpy as np

from serd_core.arrays import FloatArray
from serd_core.bayes.information import (
    expected_information_gain,
    outcome_information,
    weight_information,
)
from serd_core.bayes.laplace import Laplace, PosteriorDraws, interval_draws, laplace
from serd_core.demonstrations.decisions import Decisions
from serd_core.errors import SerdError
from serd_core.grid.grid import Grid, Outcome
from serd_core.grid.navigation import NavigationProblem
from serd_core.learners.fit_result import FitResult, StandardErrors
from serd_core.semi_markov.models import NO_LAW, SemiMarkovModels
from serd_core.semi_markov.place import dwell_summary
from serd_core.uncertainty.standard_errors import (
    fit_information,
    standard_errors,
)
from serd_files.table import OptionalFloat, read_rows, write_rows

#: Share of the posterior within the intervals.
MASS = 0.9


@dataclass(frozen=True)
class OutcomeRow:
    """The posterior of one outcome probability; what is in nats is of its whole model.

    outcome_known_from: that of this outcome, which the data of its model may leave as it was.
    lower, median, upper: NaN where the chains of the posterior did not mix, as in all tables here.
    known_from: counts, choices, both, or prior only; shared_most_with: a feature of the reward.
    """

    model: str
    outcome: str
    decisions: float
    lower: OptionalFloat
    median: OptionalFloat
    upper: OptionalFloat
    known_from: str
    outcome_known_from: str
    from_transitions_nats: float
    from_choices_nats: float
    shared_with_rewards_nats: float
    shared_most_with: str


@dataclass(frozen=True)
class DurationRow:
    """The posterior of how long a move of one outcome model takes on average.

    dwell_times: how many inform it. over_forward: the same interval of the mean over the
    probability of FORWARD. known_from: dwell times, choices, both, or prior only. confounded_with:
    the feature whose weight correlates most with the log mean; near 1 or -1 the decisions cannot
    distinguish a dislike of such moves from their slowness.
    """

    model: str
    dwell_times: float
    lower_s: OptionalFloat
    median_s: OptionalFloat
    upper_s: OptionalFloat
    over_forward_lower_s: OptionalFloat
    over_forward_median_s: OptionalFloat
    over_forward_upper_s: OptionalFloat
    known_from: str
    from_dwell_times_nats: float
    from_choices_nats: float
    confounded_with: str
    correlation: float


@dataclass(frozen=True)
class WeightRow:
    """The posterior of one reward weight; known_from: choices, or prior only."""

    feature: str
    lower: OptionalFloat
    median: OptionalFloat
    upper: OptionalFloat
    known_from: str
    from_choices_nats: float


@dataclass(frozen=True)
class DynamicsRow:
    """The probability of one outcome by the moves alone, and by moves and choices together.

    Each is a median with the ends of the interval that holds `MASS`.
    """

    model: str
    outcome: str
    counted_lower: float
    counted: float
    counted_upper: float
    joint_lower: float
    joint: float
    joint_upper: float


def dynamics_rows(
    problem: NavigationProblem, counted: PosteriorDraws, joint: PosteriorDraws
) -> tuple[DynamicsRow, ...]:
    """Both dynamics of all outcomes, by model, from draws of their posteriors."""
    models = problem.outcome_models
    shares = 0.5 + np.array([-0.5, 0.0, 0.5]) * MASS
    columns = [
        np.quantile(models.local_probabilities(each.truth[:, : models.n_energies]), shares, axis=0)
        for each in (counted, joint)
    ]
    table = np.concatenate(columns).transpose(1, 2, 0)
    return tuple(
        DynamicsRow(model, outcome.name.lower(), *table[m, outcome].tolist())
        for m, model in enumerate(problem.model_names)
        for outcome in Outcome
    )


@dataclass(frozen=True)
class GainRow:
    """What a demonstration that starts in a cell is expected to add."""

    x_m: float
    y_m: float
    gain_nats: float


@dataclass(frozen=True)
class Knowledge:
    """outcomes: by model, then by outcome; gains: of every cell, in the order of the states.

    durations: by model; none where the fit learned by decisions that take the same time.
    weights: by feature.
    """

    outcomes: tuple[OutcomeRow, ...]
    gains: tuple[GainRow, ...]
    durations: tuple[DurationRow, ...] = ()
    weights: tuple[WeightRow, ...] = ()

    @property
    def gain_nats(self) -> FloatArray:
        """(S,) of all cells."""
        return np.array([row.gain_nats for row in self.gains])

    @property
    def next_start(self) -> GainRow:
        """Where a demonstration is expected to add most."""
        return max(self.gains, key=lambda row: row.gain_nats)

    @property
    def by_model(self) -> dict[str, tuple[OutcomeRow, ...]]:
        """The rows of each outcome model."""
        groups = groupby(self.outcomes, key=lambda row: row.model)
        return {model: tuple(rows) for model, rows in groups}


def posterior_of(
    problem: NavigationProblem, decisions: Decisions, fit: FitResult
) -> Laplace | None:
    """None where the fit has none: its prior is no density, or it is at no maximum."""
    try:
        return laplace(problem, decisions, fit)
    except SerdError:
        return None


def knowledge_of(
    problem: NavigationProblem, posterior: Laplace, of_moves: Laplace | None = None
) -> Knowledge | None:
    """None where the dynamics were not learned.

    of_moves: posterior of the moves alone, where that of choices has counted dynamics; then gains
    are about rewards.
    """
    try:
        found = outcome_information(of_moves or posterior, MASS)
        gain = expected_information_gain(posterior)
        if of_moves is not None:
            draws = interval_draws(posterior, np.random.default_rng(0), MASS)
            found = replace(
                found,
                from_choices=np.zeros_like(found.from_choices),
                weights=draws.interval(draws.reward, MASS),
                from_choices_of_weights=weight_information(posterior, draws),
            )
    except SerdError:
        return None
    outcomes = tuple(
        OutcomeRow(
            model=model,
            outcome=outcome.name.lower(),
            decisions=float(found.n_decisions[m]),
            lower=float(found.lower[m, outcome]),
            median=float(found.median[m, outcome]),
            upper=float(found.upper[m, outcome]),
            known_from=found.source(m),
            outcome_known_from=found.source_of_outcome(m, outcome),
            from_transitions_nats=float(found.from_transitions[m]),
            from_choices_nats=float(found.from_choices[m]),
            shared_with_rewards_nats=float(found.shared[m]),
            shared_most_with=problem.feature_names[found.partner[m]],
        )
        for m, model in enumerate(problem.model_names)
        for outcome in Outcome
    )
    points = zip(problem.grid.centers_m.tolist(), gain.tolist(), strict=True)
    gains = tuple(GainRow(x_m, y_m, nats) for (x_m, y_m), nats in points)
    weights = tuple(
        WeightRow(
            feature=feature,
            lower=float(found.weights[0, f]),
            median=float(found.weights[1, f]),
            upper=float(found.weights[2, f]),
            known_from=found.source_of_weight(f),
            from_choices_nats=float(found.from_choices_of_weights[f]),
        )
        for f, feature in enumerate(problem.feature_names)
    )
    durations = tuple(_durations(problem, of_moves or posterior, found.draws))
    return Knowledge(outcomes, gains, durations, weights)


def _durations(
    problem: NavigationProblem, posterior: Laplace, draws: PosteriorDraws
) -> Iterable[DurationRow]:
    """Of each outcome model with a law."""
    model = problem.mdp.transitions
    if not isinstance(model, SemiMarkovModels):
        return
    found = dwell_summary(posterior, draws, MASS)
    over_forward_s = np.exp(found.log_mean_over_probability[:, :, Outcome.FORWARD])
    for m, law in enumerate(model.law_of[:, Outcome.FORWARD]):
        if law == NO_LAW:
            continue
        correlation = found.weight_correlation[:, law]
        partner = int(np.argmax(np.abs(correlation)))
        lower_s, median_s, upper_s = found.mean_interval_s[:, law].tolist()
        over_lower_s, over_median_s, over_upper_s = over_forward_s[:, m].tolist()
        yield DurationRow(
            model=problem.model_names[m],
            dwell_times=float(found.n_dwells[law]),
            lower_s=lower_s,
            median_s=median_s,
            upper_s=upper_s,
            over_forward_lower_s=over_lower_s,
            over_forward_median_s=over_median_s,
            over_forward_upper_s=over_upper_s,
            known_from=found.source(law),
            from_dwell_times_nats=float(found.from_dwells[law]),
            from_choices_nats=float(found.from_choices[law]),
            confounded_with=problem.feature_names[partner],
            correlation=float(correlation[partner]),
        )


def knowledge_lines(known: Knowledge, problem: NavigationProblem) -> Iterable[str]:
    """Lines per outcome model that applies somewhere, and where to demonstrate next."""
    used = [problem.model_names[m] for m in problem.used_models]
    for model in used:
        row = known.by_model[model][Outcome.FORWARD]
        yield (
            f"{model.replace('_', ' ')}: {row.known_from}; {row.decisions:.0f} decisions:"
            f" {row.from_transitions_nats:.2f} nats, choices: {row.from_choices_nats:.2f} nats"
            f" ({row.shared_with_rewards_nats:.2f} shared with rewards, most with"
            f" {row.shared_most_with.replace('_', ' ')}); forward {_percent(row)}"
        )
    durations = [row for row in known.durations if row.model in used]
    for each in durations:
        yield (
            f"{each.model.replace('_', ' ')}, time of a move: {each.known_from};"
            f" {each.dwell_times:.0f} dwell times: {each.from_dwell_times_nats:.2f} nats, choices:"
            f" {each.from_choices_nats:.2f} nats; mean"
            f" {spanned(each.lower_s, each.median_s, each.upper_s, '.2f', ' s')}, over P(forward)"
            f" {spanned(*_over_forward_s(each), '.3g', ' s')}"
        )
    if durations:
        most = max(durations, key=lambda row: abs(row.correlation))
        yield (
            f"most confounded: how long a move {most.model.replace('_', ' ')} takes and the weight"
            f" of {most.confounded_with.replace('_', ' ')}, correlation {most.correlation:+.2f}"
        )
    best = known.next_start
    yield (
        f"a demonstration from {best.x_m:g},{best.y_m:g} is expected to teach most:"
        f" {best.gain_nats:.2f} nats"
    )


def _over_forward_s(row: DurationRow) -> tuple[float, float, float]:
    return row.over_forward_lower_s, row.over_forward_median_s, row.over_forward_upper_s


def _percent(row: OutcomeRow) -> str:
    return spanned(100 * row.lower, 100 * row.median, 100 * row.upper, ".0f", " %")


def spanned(lower: float, median: float, upper: float, form: str, unit: str = "") -> str:
    """An interval in words, which says where there is none."""
    if np.isnan(lower + median + upper):
        return "no interval, as the chains of the posterior did not mix"
    return f"{median:{form}}{unit} ({lower:{form}} to {upper:{form}})"


def save_knowledge(files: Mapping[str, Path], known: Knowledge) -> None:
    """Write all tables."""
    write_rows(files["posterior"], OutcomeRow, known.outcomes)
    write_rows(files["durations"], DurationRow, known.durations)
    write_rows(files["weights"], WeightRow, known.weights)
    write_rows(files["gain"], GainRow, known.gains)


def load_knowledge(files: Mapping[str, Path], grid: Grid) -> Knowledge | None:
    """What `save_knowledge` wrote for this grid; None where the fit had no posterior."""
    if not files["posterior"].exists():
        return None
    outcomes = read_rows(files["posterior"], OutcomeRow)
    gains = read_rows(files["gain"], GainRow)
    if len(gains) != grid.n_states:
        raise SerdError(
            f"{files['gain']} must have a row for each of {grid.n_states} cells, got {len(gains)}"
            "; learn again"
        )
    durations = read_rows(files["durations"], DurationRow)
    return Knowledge(outcomes, gains, durations, read_rows(files["weights"], WeightRow))


def both_dynamics(files: Mapping[str, Path]) -> tuple[DynamicsRow, ...]:
    """The rows beside a model; none where its dynamics were not compared."""
    path = files["dynamics"]
    return read_rows(path, DynamicsRow) if path.exists() else ()


@dataclass(frozen=True, eq=False)
class Certainty:
    """errors: with the prior's part, None where `problem` states why there are none."""

    errors: StandardErrors | None
    problem: str = ""


def certainty_of(problem: NavigationProblem, decisions: Decisions, fit: FitResult) -> Certainty:
    """Standard errors with the prior's part."""
    try:
        information = fit_information(problem, decisions, fit)
        return Certainty(standard_errors(problem, information, information.observed))
    except SerdError as error:
        return Certainty(None, str(error))
