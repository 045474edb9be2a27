"""The pace of a person, by which all that the person does takes a shorter time.

A person of pace v goes through two columns of cells, as many as are seen before a forecast, in
times t, whose mean over all people is m:

    x = t / m,    x | v ~ Gamma(shape k, rate k v),    v ~ Gamma(shape a, rate a - 1),    E[x] = 1

After n times v has the law Gamma(a + n k, a - 1 + k sum x); a and k have the highest marginal
likelihood of the people learned from. Learners get dwell times multiplied by a draw of v for each
of these people, and a distribution F(t) of what they learned becomes the mean of F(v t). Waits keep
their length where they are learned, which is exact where nobody waits.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.optimize import minimize
from scipy.special import gammaln
from scipy.stats import gamma

from lab.experiments.study.people.people import Asked
from serd_core.arrays import FloatArray, IntArray
from serd_core.arrival.chain import ArrivalByState
from serd_core.arrival.law import ArrivalLaw
from serd_core.demonstrations.decisions import TimedDecisions
from serd_core.grid.grid import Action, Grid

#: Quantiles that stand for the law of a pace.
_SHARES = (np.arange(25) + 0.5) / 25


@dataclass(frozen=True, eq=False)
class Paces:
    """The law of paces: mean_s is m, between a, and within k."""

    grid: Grid
    mean_s: float
    between: float
    within: float

    @classmethod
    def of(cls, grid: Grid, decisions: TimedDecisions) -> "Paces":
        """Those of people, an episode each; decisions: in the order of episodes and times."""
        person, time_s = _times(grid, decisions)
        mean_s, n = float(time_s.mean()), np.bincount(person)
        x = time_s / mean_s
        total, logs = np.bincount(person, x), np.bincount(person, np.log(x))

        def cost(parameters: FloatArray) -> float:
            b, k = np.exp(parameters)
            shape, rate = 1.0 + b + n * k, b + k * total
            of_times = n * (k * np.log(k) - gammaln(k)) + (k - 1.0) * logs
            of_people = (1.0 + b) * np.log(b) - gammaln(1.0 + b)
            return -float((of_times + of_people + gammaln(shape) - shape * np.log(rate)).sum())

        found = minimize(cost, np.log([20.0, 5.0]), bounds=[(-3.0, 10.0), (-3.0, 6.0)])
        return cls(grid, mean_s, 1.0 + float(np.exp(found.x[0])), float(np.exp(found.x[1])))

    def law(self, decisions: TimedDecisions, n_people: int) -> Any:
        """The laws of v of (P,) people given the decisions of each."""
        person, time_s = _times(self.grid, decisions)
        n, total_s = (np.bincount(person, each, n_people) for each in (None, time_s))
        rate = self.between - 1.0 + self.within * total_s / self.mean_s
        return gamma(self.between + n * self.within, scale=1.0 / rate)

    def at_pace_one(
        self, decisions: TimedDecisions, longest_s: float, rng: np.random.Generator
    ) -> TimedDecisions:
        """Decisions whose moves take as long as at pace one; longest_s: of a decision."""
        paces = self.law(decisions, int(decisions.episode.max()) + 1).rvs(random_state=rng)
        dwell_s = np.minimum(decisions.dwell_s * paces[decisions.episode], longest_s)
        moved = decisions.next_state != decisions.state
        return replace(decisions, dwell_s=np.where(moved, dwell_s, decisions.dwell_s))

    def own_laws(
        self, times_s: FloatArray, arrival: ArrivalByState, asked: list[Asked], seen: TimedDecisions
    ) -> list[ArrivalLaw]:
        """The forecasts asked for, by arrivals at pace one; seen: decisions of all until then."""
        paces = self.law(seen, 1 + max(one.walker for one in asked)).ppf(_SHARES[:, None])
        found = []
        for one in asked:
            cdf = np.interp(paces[:, [one.walker]] * times_s, times_s, arrival.cdf[:, one.state])
            ever = float(arrival.arrival_probability[one.state])
            found.append(ArrivalLaw(times_s, cdf.mean(axis=0), ever))
        return found


def _times(grid: Grid, decisions: TimedDecisions) -> tuple[IntArray, FloatArray]:
    """(N,) person and time of each way through two columns."""
    ahead = grid.neighbours[decisions.state, Action.EAST] == decisions.next_state
    rows = np.flatnonzero(ahead & (decisions.next_state != decisions.state))
    person = decisions.episode[rows]
    rows = rows[(np.arange(len(rows)) - np.searchsorted(person, person)) % 2 == 1]
    person, ends_s = decisions.episode[rows], (decisions.time_s + decisions.dwell_s)[rows]
    begins_s = decisions.time_s[np.searchsorted(decisions.episode, person)]
    goes_on = person[1:] == person[:-1]
    begins_s[1:][goes_on] = ends_s[:-1][goes_on]
    return person, ends_s - begins_s
