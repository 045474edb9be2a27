"""What choices reveal of how long a move takes that nobody makes: a ring with a stream of people.

24 places in two lanes. Against the stream a place takes three times as long as with it, so experts
who start between 10 and 14 places before the goal go round with it. Three learners look on: one of
durations, rewards and outcomes at once, one that counts durations and then learns rewards, and one
with a discount per decision, for whom moves take no time. Either each action has one outcome, or it
may also end aside, and nobody knows how often moves against the stream do. With places, moves in
state s also take exp(b_s) times as long, b_s and their deviation drawn in each world from the prior
of places, and the first two learners estimate these multipliers afterwards. Last, durations against
the stream are drawn, too, from their prior given the others, so that intervals can be calibrated.

Robots plan with the posterior mean of discounted outcomes, the last learner's with its estimate.
"""

from dataclasses import dataclass
from functools import partial

import numpy as np
import pandas as pd

import serd_core as sc
from lab.experiments.running.experiment import Count, Findings, SeededConfig, Session, Sizes
from lab.experiments.running.tables import Row
from serd_core.arrays import FloatArray, IntArray
from serd_core.demonstrations.observations import observe
from serd_core.semi_markov.dwell_likelihood import PRIOR
from serd_core.semi_markov.models import require_timed
from serd_core.semi_markov.place import MEDIAN, SPREAD, PlacePaces
from serd_files.settings import setting

PLACES, GOAL = 24, 0
WITH, AGAINST, ACROSS, WAIT = range(4)
#: Probabilities of each action's outcome, of staying, and of the other lane or a drift.
SIDE_OUTCOMES = np.array(
    [[0.92, 0.04, 0.04], [0.85, 0.1, 0.05], [0.85, 0.1, 0.05], [0.6, 0.3, 0.1]]
)
WITH_PLACES, FROM_PRIOR = "side outcomes, places", "side outcomes, places, drawn durations"
CASES = {"one outcome": np.ones((4, 1)), "side outcomes": SIDE_OUTCOMES}
CASES |= {WITH_PLACES: SIDE_OUTCOMES, FROM_PRIOR: SIDE_OUTCOMES}
MEAN_S = np.array([1.0, 3.0, 1.2, 1.0])
STARTS = np.arange(10, 15)
#: Of an interval that holds 90 % of a posterior, in standard deviations of a normal one, too.
MASS_ENDS, NORMAL_END = (0.05, 0.95), 1.645
TOGETHER, TWO_STEPS, PER_DECISION = "durations learned", "two steps", "discount per decision"


class DurationsConfig(SeededConfig):
    """Experts on the ring."""

    n_repetitions: Count = setting(100, "worlds, with demonstrations of their own")
    sizes: Sizes = setting((3, 10, 30), "demonstrations of a world")
    goal_weight: float = setting(4.0, "of the goal in the expert's reward", gt=0)
    discount: float = setting(0.97, "discount per second", gt=0, lt=1)
    shape: float = setting(6.0, "shape of the gamma laws of dwell times", gt=0)
    until_command_s: float = setting(8.0, "mean seconds until another command", gt=0)
    distances: Sizes = setting((5, 7, 9), "places before the goal where robots start")
    draws: Count = setting(64, "draws of a posterior")


@dataclass(frozen=True, eq=False)
class World:
    """A ring as learners see it, and the truth about it.

    paced: with the (S,) log multipliers of places; truth: (N,) parameters; table: discounted
    outcomes of paced.
    """

    config: DurationsConfig
    plain: sc.TabularProblem
    timed: sc.TabularProblem
    paced: sc.TabularProblem
    log_pace: FloatArray
    truth: FloatArray
    table: FloatArray

    def ways(self, problem: sc.TabularProblem, table: FloatArray) -> list[int]:
        """First move along the ring, or `WAIT`, of the best plan from each distance."""
        greedy = sc.optimal_policy(problem, np.ones(1), table).greedy
        found = []
        for distance in self.config.distances:
            state = 2 * distance
            if greedy[state] == ACROSS:
                state += 1
            found.append(int(greedy[state]))
        return found


def run_durations(config: DurationsConfig, session: Session) -> Findings:
    """Bias, deviation and coverage of the duration of a move that nobody makes, and plans."""
    table = session.repeat(partial(learn_one_world, config), config.n_repetitions, config)
    summary = summary_of(table)
    return Findings(summary, {"worlds.csv": table, "summary.csv": summary})


def ring(discount: float, n_outcomes: int) -> sc.TabularProblem:
    """The decision problem, in which moves take no time."""
    state = np.arange(2 * PLACES)
    place, lane = np.divmod(state, 2)
    onward, back, aside = (
        ((place + step) % PLACES) * 2 + (lane + shift) % 2
        for step, shift in ((1, 0), (-1, 0), (0, 1))
    )
    rows = [(onward, state, aside), (back, state, aside), (aside, state, onward)]
    rows.append((state, state, onward))
    successors = np.stack([np.stack(row, axis=1) for row in rows], axis=1)
    at_goal, available = place == GOAL, np.ones((len(state), len(rows)), dtype=np.bool_)
    available[at_goal, :WAIT] = False
    successors[at_goal] = state[at_goal, None, None]
    model_of = np.tile(np.arange(len(rows)), (len(state), 1))
    models = sc.OutcomeModels(successors[:, :, :n_outcomes], model_of, available, len(rows))
    goal = np.repeat(at_goal[:, None, None].astype(np.float64), len(rows), axis=1)
    return sc.TabularProblem(sc.Mdp(models, discount), goal, ("goal",))


def world(config: DurationsConfig, case: str, rng: np.random.Generator) -> World:
    """The ring of a case, and the truth about it."""
    outcomes, log_pace = CASES[case], np.zeros(2 * PLACES)
    if case in (WITH_PLACES, FROM_PRIOR):
        deviation = MEDIAN * np.exp(SPREAD * rng.standard_normal())
        log_pace = deviation * rng.standard_normal(2 * PLACES)
    plain = ring(config.discount, outcomes.shape[1])
    timed = sc.semi_markov_problem(plain)
    paced = sc.semi_markov_problem(timed, log_pace=log_pace)
    models = require_timed(paced.mdp.transitions)
    truth = models.parameters_from(outcomes, MEAN_S, config.shape)
    if case == FROM_PRIOR:
        place = models.means.start + AGAINST
        precision = PRIOR.precision(models, truth)[place]
        others = truth[models.means] @ precision[models.means] - truth[place] * precision[place]
        truth[place] = rng.normal(-others / precision[place], 1.0 / np.sqrt(precision[place]))
    table = models.local_probabilities(truth)
    return World(config, plain, timed, paced, log_pace, truth, table)


def learn_one_world(config: DurationsConfig, number: int) -> list[Row]:
    """Rows of one repetition: every case, size and learner, each set a part of the next."""
    rows: list[Row] = []
    for place, case in enumerate(CASES):
        rng = np.random.default_rng([config.seed, number, place])
        given = world(config, case, rng)
        demonstrations = demonstrate(given, rng)
        right = given.ways(given.paced, given.table)
        for size in config.sizes:
            chosen = demonstrations.select_episodes(range(size))
            assert isinstance(chosen, sc.TimedDecisions)
            row: Row = {"case": case, "repetition": number, "size": size}
            row["moves_against"] = int(np.sum(chosen.action == AGAINST))
            row["censored"] = float(np.mean(chosen.censored))
            for learner in (TOGETHER, TWO_STEPS, PER_DECISION):
                found, plans = learn(given, learner, chosen, rng)
                for plan, (problem, table) in plans.items():
                    taken = given.ways(problem, table)
                    for distance, way, best in zip(config.distances, taken, right, strict=True):
                        found[f"{plan}_{distance}"] = float(way == best)
                rows.append(row | {"learner": learner} | found)
    return rows


def demonstrate(given: World, rng: np.random.Generator) -> sc.TimedDecisions:
    """Episodes of experts who know the ring."""
    config, starts = given.config, np.zeros(2 * PLACES)
    starts[np.concatenate([2 * STARTS, 2 * STARTS + 1])] = 0.5 / len(STARTS)
    weights = np.array([config.goal_weight])
    return sc.sample_timed_decisions(
        given.paced.mdp,
        sc.soft_policy(given.paced, weights, given.table).probabilities,
        given.truth,
        starts,
        n_episodes=max(config.sizes),
        n_steps=400,
        rng=rng,
        mean_until_command_s=config.until_command_s,
    )


def learn(
    given: World, learner: str, decisions: sc.TimedDecisions, rng: np.random.Generator
) -> tuple[Row, dict[str, tuple[sc.TabularProblem, FloatArray]]]:
    """What a learner finds, and the problems and discounted outcomes that robots may plan with."""
    problem = given.plain if learner == PER_DECISION else given.timed
    belief = sc.FixedBelief() if learner == TWO_STEPS else sc.TiedBelief()
    fit = sc.fit_mdce_serd(problem, decisions, belief=belief)
    weight = max(float(fit.reward_weights[0]), 1e-9) / given.config.goal_weight
    row: Row = {"converged": float(fit.converged), "weight_bias": float(np.log(weight))}
    if learner == PER_DECISION:
        return row, {"right": (problem, fit.outcome_probabilities)}
    theta = fit.parameters.truth
    if learner == TWO_STEPS:
        drawn = counted_draws(problem, decisions, theta, given.config.draws, rng)
    else:
        posterior = sc.laplace(problem, decisions, fit)
        drawn = sc.laplace_draws(posterior, rng, given.config.draws).truth
    row |= duration_of(given, theta, drawn)
    plans = {"right": (problem, _mean_outcomes(problem, drawn))}
    if given.log_pace.any():
        places = sc.fit_places(problem, decisions, theta)
        row |= pace_of(given, places, np.unique(decisions.state))
        plans["no_places_right"] = plans["right"]
        problem = sc.semi_markov_problem(problem, log_pace=places.log_pace)
        plans["right"] = problem, _mean_outcomes(problem, drawn)
    plans["mode_right"] = problem, problem.mdp.transitions.local_probabilities(theta)
    return row, plans


def _mean_outcomes(problem: sc.TabularProblem, draws: FloatArray) -> FloatArray:
    """(R, K) mean of K / gamma over (n, N) posterior draws, with which a robot plans."""
    return np.asarray(problem.mdp.transitions.local_probabilities(draws).mean(axis=0))


def counted_draws(
    problem: sc.TabularProblem,
    decisions: sc.TimedDecisions,
    theta: FloatArray,
    n: int,
    rng: np.random.Generator,
) -> FloatArray:
    """(n, N) draws of counted dwell times, by Laplace's approximation, and counted outcomes."""
    models, drawn = require_timed(problem.mdp.transitions), np.tile(theta, (n, 1))
    dwells = observe(problem, decisions).dwells
    assert dwells is not None
    information = PRIOR.precision(models, theta) - dwells.hessian(theta)
    laws = slice(models.means.start, models.n_parameters)
    covariance = np.linalg.inv(information[laws, laws])
    drawn[:, laws] = rng.multivariate_normal(theta[laws], covariance, n)
    return drawn


def duration_of(given: World, theta: FloatArray, drawn: FloatArray) -> Row:
    """Log mean dwell time of moves against the stream: its mode, and its (n, N) draws.

    ratio: the same of mu / P(forward).
    """
    models = require_timed(given.timed.mdp.transitions)
    place, wanted = models.means.start + AGAINST, given.truth
    logs, low, high = (drawn[:, place], *np.quantile(drawn[:, place], MASS_ENDS))

    def log_ratio(parameters: FloatArray) -> float:
        forward = models.outcomes.local_probabilities(parameters)[AGAINST, 0]
        return float(parameters[place] - np.log(forward))

    ratios = np.array([log_ratio(each) for each in drawn])
    true_ratio = log_ratio(wanted)
    ends = np.quantile(ratios, MASS_ENDS)
    return {
        "bias": float(theta[place] - wanted[place]),
        "mean_bias": float(logs.mean() - wanted[place]),
        "deviation": float(logs.std()),
        "held": float(low <= wanted[place] <= high),
        "ratio_bias": log_ratio(theta) - true_ratio,
        "ratio_mean_bias": float(ratios.mean()) - true_ratio,
        "ratio_deviation": float(ratios.std()),
        "ratio_held": float(ends[0] <= true_ratio <= ends[1]),
    }


def pace_of(given: World, places: PlacePaces, seen: IntArray) -> Row:
    """Errors of log multipliers of (v,) states, and if all were 0; relative: from their mean."""
    wanted, error = given.log_pace[seen], (places.log_pace - given.log_pace)[seen]
    held = np.abs(error) <= NORMAL_END * places.its_deviation[seen]
    return {
        "pace_error": float(np.sqrt(np.mean(error**2))),
        "pace_error_of_none": float(np.sqrt(np.mean(wanted**2))),
        "relative_pace_error": float(np.std(error)),
        "relative_pace_error_of_none": float(np.std(wanted)),
        "pace_deviation": places.deviation,
        "pace_held": float(np.mean(held)),
    }


def summary_of(table: pd.DataFrame) -> pd.DataFrame:
    """Means over the worlds, and what 5 % of them are below and above; worlds: their number.

    avoided: whether those are meant whose demonstrations have no move against the stream.
    """
    avoided = table["moves_against"] == 0
    groups = ["case", "avoided", "size", "learner"]
    numbers = table.drop(columns="repetition").assign(avoided=avoided)
    grouped = numbers.groupby(groups, sort=False)
    low, high = (grouped.quantile(end) for end in MASS_ENDS)
    found = {"mean": grouped.mean(), "5 %": low, "95 %": high}
    worlds = grouped.size().rename("worlds").reset_index()
    return worlds.merge(pd.concat(found, names=["over worlds"]).reset_index(), on=groups)
