"""Plans that avoid what is not known: the ring of `durations`, few demonstrations.

Experts start where the way with the stream is right, so nearly nobody goes against it, and robots
start nearer to the goal. Moves against the stream are three times as slow as with it, or jammed so
that nine in ten end where they began, or as slow as their prior has it given the others. SERD
learns from few demonstrations; robots plan by the posterior mean, or by a quantile over the draws
(`pessimistic_policy`). Late is who arrives after the time by which nine in ten arrive who know the
truth; trapped, who has not arrived after ten times the mean of these.
"""

from dataclasses import dataclass
from functools import partial

import numpy as np
import pandas as pd
import scipy.stats

import serd_core as sc
from lab.experiments.durations import (
    AGAINST,
    CASES,
    FROM_PRIOR,
    GOAL,
    DurationsConfig,
    World,
    demonstrate,
    world,
)
from lab.experiments.running.experiment import Findings, Session, Sizes
from lab.experiments.running.tables import Row
from serd_core.arrays import FloatArray, IntArray
from serd_core.semi_markov.models import require_timed
from serd_files.settings import setting

SLOW, JAMMED, DRAWN = "slow", "jammed", "drawn"
#: P(forward), of staying and of ending aside of a move against the stream in a jam.
JAM = np.array([0.1, 0.88, 0.02])
STEP_S, LATE_SHARE, TRAPPED_AFTER, N_STEPS = 0.5, 0.9, 10.0, 2000
MEASURES = ("late", "trapped", "mean_s")


class AvoidanceConfig(DurationsConfig):
    """Few demonstrations, and robots at several distances."""

    sizes: Sizes = setting((2, 3, 4), "demonstrations of a world")
    distances: Sizes = setting((3, 5, 7, 9, 11), "places before the goal where robots start")
    quantiles: tuple[float, ...] = setting((0.25, 0.1), "of the draws, by which plans are made")


@dataclass(frozen=True, eq=False)
class Goal:
    """The ring with its goal, as laws of arrival take it."""

    mdp: sc.Mdp
    goal_states: IntArray


def run_avoidance(config: AvoidanceConfig, session: Session) -> Findings:
    """Late and trapped robots by plan, and by how much they differ from the posterior mean."""
    table = session.repeat(partial(plan_in_one_world, config), config.n_repetitions, config)
    summary = summary_of(table)
    return Findings(summary, {"worlds.csv": table, "summary.csv": summary})


def given_world(config: DurationsConfig, case: str, rng: np.random.Generator) -> World:
    """A ring with side outcomes, whose moves against the stream are those of the case."""
    given = world(config, FROM_PRIOR if case == DRAWN else "side outcomes", rng)
    if case != JAMMED:
        return given
    outcomes = CASES["side outcomes"].copy()
    outcomes[AGAINST] = JAM
    models = require_timed(given.timed.mdp.transitions)
    means, shape = np.exp(given.truth[models.means]), config.shape
    truth = models.parameters_from(outcomes, means, shape)
    table = models.local_probabilities(truth)
    return World(config, given.plain, given.timed, given.paced, given.log_pace, truth, table)


def plan_in_one_world(config: AvoidanceConfig, number: int) -> list[Row]:
    """A row per case, size, plan and distance."""
    rows: list[Row] = []
    for place, case in enumerate((SLOW, JAMMED, DRAWN)):
        rng = np.random.default_rng([config.seed, number, place])
        given = given_world(config, case, rng)
        demonstrations = demonstrate(given, rng)
        best = sc.optimal_policy(given.paced, np.ones(1), given.table).probabilities
        limits = _limits(given, best)
        for size in config.sizes:
            chosen = demonstrations.select_episodes(range(size))
            assert isinstance(chosen, sc.TimedDecisions)
            about: Row = {"case": case, "repetition": number, "size": size}
            about["moves_against"] = int(np.sum(chosen.action == AGAINST))
            for plan, policy in _plans(given, chosen, rng).items():
                law = _law(given, policy)
                for distance in config.distances:
                    found = _arrival(law[:, 2 * distance], *limits[distance])
                    rows.append(about | {"plan": plan, "distance": distance} | found)
    return rows


def _plans(
    given: World, decisions: sc.TimedDecisions, rng: np.random.Generator
) -> dict[str, FloatArray]:
    """(S, A) policies by the posterior mean, and by each quantile."""
    fit = sc.fit_mdce_serd(given.timed, decisions)
    posterior = sc.laplace(given.timed, decisions, fit)
    tables = sc.laplace_draws(posterior, rng, given.config.draws).outcome_probabilities
    mean = sc.optimal_policy(given.timed, np.ones(1), tables.mean(axis=0))
    plans = {"mean": mean.probabilities}
    assert isinstance(given.config, AvoidanceConfig)
    for quantile in given.config.quantiles:
        plan = sc.pessimistic_policy(given.timed, np.ones(1), tables, quantile)
        plans[f"quantile {quantile:g}"] = plan.probabilities
    return plans


def _law(given: World, policy: FloatArray) -> FloatArray:
    """(N_STEPS + 1, S) probability of having arrived by the truth."""
    goal = Goal(given.paced.mdp, np.array([2 * GOAL, 2 * GOAL + 1]))
    return sc.timed_arrival(goal, policy, given.truth, STEP_S, N_STEPS).cdf


def _limits(given: World, best: FloatArray) -> dict[int, tuple[float, float]]:
    """Seconds after which a robot is late, and trapped, by distance."""
    own = {distance: _law(given, best)[:, 2 * distance] for distance in given.config.distances}
    return {
        distance: (STEP_S * float(np.argmax(cdf >= LATE_SHARE)), TRAPPED_AFTER * _mean_s(cdf))
        for distance, cdf in own.items()
    }


def _arrival(cdf: FloatArray, late_s: float, trapped_s: float) -> Row:
    """Probabilities of being late and trapped, and the mean time up to the end of the law."""
    by = [float(cdf[min(round(limit / STEP_S), N_STEPS)]) for limit in (late_s, trapped_s)]
    return {"late": 1.0 - by[0], "trapped": 1.0 - by[1], "mean_s": _mean_s(cdf)}


def _mean_s(cdf: FloatArray) -> float:
    return STEP_S * float(np.sum(1.0 - cdf))


def summary_of(table: pd.DataFrame) -> pd.DataFrame:
    """Means over worlds and distances by plan, and by how much they differ from the mean plan.

    worst_tenth: of worlds, are above; low, high: 95 % interval of the difference in the same
    worlds, by Student's t.
    """
    keys = ["case", "size", "plan"]
    worlds = table.groupby([*keys, "repetition"], sort=False)[list(MEASURES)].mean().reset_index()
    rows = []
    for (case, size, plan), here in worlds.groupby(keys, sort=False):
        same = (worlds["case"] == case) & (worlds["size"] == size) & (worlds["plan"] == "mean")
        base = worlds[same].set_index("repetition")
        own = here.set_index("repetition")
        for measure in MEASURES:
            apart = (own[measure] - base[measure]).to_numpy()
            half = scipy.stats.t.ppf(0.975, len(apart) - 1) * apart.std(ddof=1) / len(apart) ** 0.5
            row = {"case": case, "size": size, "plan": plan, "measure": measure}
            row |= {"worlds": len(own), "value": own[measure].mean()}
            row |= {"worst_tenth": own[measure].quantile(0.9), "difference": apart.mean()}
            rows.append(row | {"low": apart.mean() - half, "high": apart.mean() + half})
    return pd.DataFrame(rows)
