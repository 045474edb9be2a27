"""One case of a task: what a method is given, what it returns, and how that is scored.

A method is given arrays by name (`Case.given`) and returns arrays by name, of which each may be
missing:

    policy, transfer_policy  (S, A) predicted decisions of the expert, in the task and another one
    weights                  (F,) reward weights
    table                    (R, K) probabilities of outcomes, discounted where moves take time
    draws_weights            (n, F) draws of the posterior, or of an estimator's distribution
    draws_table              (n, R, K)
    unstated                 (F,) weights of which the method states no interval

Without policies they are the soft policies of the weights. Methods that learn rewards alone have
the counted dynamics, which they are given.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

import serd_core as sc
from lab.routes.network import RouteNetwork, Trips
from lab.routes.recursive_logit import RouteLikelihood
from serd_core.arrays import FloatArray, IntArray
from serd_core.demonstrations.decisions import Decisions, TimedDecisions
from serd_core.demonstrations.observations import observe
from serd_core.dynamics.outcome_models import OutcomeModels
from serd_core.dynamics.transition_model import transitions_of
from serd_core.mdp.problem import TabularProblem

#: Less probable decisions and moves count as if they had this probability.
FLOOR = 1e-6
#: Of an interval that should hold 90 % of what is true.
ENDS = (0.05, 0.95)
Arrays = Mapping[str, Any]


@dataclass(frozen=True, eq=False)
class Target:
    """Decisions to predict. share: (S, A) of each, which sum to 1; best: score of the truth."""

    share: FloatArray
    best: float = 0.0

    @classmethod
    def of_expert(cls, share: FloatArray, policy: FloatArray) -> "Target":
        """The decisions of a known (S, A) policy, whose own score is then 0."""
        target = cls(share)
        return cls(share, target.score(policy))

    def score(self, policy: FloatArray) -> float:
        """Log-likelihood per decision, less that of the truth where it is known."""
        return float(np.sum(self.share * np.log(np.maximum(policy, FLOOR)))) - self.best


@dataclass(frozen=True, eq=False)
class Case:
    """Decisions to learn from, and what is known about the truth.

    transfer: another task with the same rewards and dynamics. truth: (R, K) true outcomes, weights:
    (F,) true ones, None where nobody knows them. held_out: decisions of which the moves are
    predicted then.
    """

    problem: TabularProblem
    decisions: Decisions
    target: Target
    transfer: TabularProblem | None = None
    transfer_target: Target | None = None
    truth: FloatArray | None = None
    weights: FloatArray | None = None
    held_out: Decisions | None = None

    @property
    def _timed(self) -> bool:
        return isinstance(self.decisions, TimedDecisions)

    def given(self) -> Arrays:
        """What a method is given; counted (R, K) outcomes, and their `transitions` (S, A, S)."""
        models, found = self.problem.mdp.transitions.moves, dict[str, Any](self.decisions.columns())
        assert isinstance(models, OutcomeModels)
        found |= {"n_models": models.n_models, "discount": self.problem.mdp.discount}
        counted = sc.estimate_dynamics(self.problem, self.decisions)
        found |= {} if self._timed else {"counted": counted}
        for prefix, problem in (("", self.problem), ("transfer_", self.transfer)):
            if problem is None:
                continue
            own = problem.mdp.transitions.moves
            assert isinstance(own, OutcomeModels)
            found |= {f"{prefix}{name}": getattr(own, name) for name in _MODELS}
            found[f"{prefix}features"] = problem.features
            if not self._timed:
                dense = transitions_of(own, counted).matrix.toarray()
                found[f"{prefix}transitions"] = dense.reshape(*own.available.shape, -1)
        return found

    def scores(self, result: Arrays) -> dict[str, float]:
        """The columns of the table for what a method returned."""
        table, found = result.get("table"), dict[str, float]()
        if table is None and "weights" in result:
            parameters = sc.estimate_dynamics(self.problem, self.decisions)
            table = parameters if parameters.ndim == 2 else None
        for name, problem, target, key in (
            ("log-likelihood", self.problem, self.target, "policy"),
            ("transfer", self.transfer, self.transfer_target, "transfer_policy"),
        ):
            policy = result.get(key)
            if target is None or problem is None:
                continue
            if policy is None and "weights" in result:
                policy = sc.soft_policy(problem, result["weights"], table).probabilities
            if policy is not None:
                found[name] = target.score(policy)
        if table is not None:
            found["divergence"] = self._divergence(table)
        return found | self._coverage(result)

    def _divergence(self, table: FloatArray) -> float:
        """Of the table from the truth; without a truth the log loss of held-out moves."""
        if self.truth is not None:
            pairs = zip(self._shares(self.truth), self._shares(table), strict=True)
            return float(np.mean([np.sum(t * np.log(t / np.maximum(p, FLOOR))) for t, p in pairs]))
        assert self.held_out is not None
        seen = self.held_out
        matrix = transitions_of(self.problem.mdp.transitions, table).matrix
        row = seen.state * self.problem.mdp.n_actions + seen.action
        share = np.asarray(matrix[row, seen.next_state]).ravel()
        return -float(np.mean(np.log(np.maximum(share, FLOOR))))

    def _shares(self, table: FloatArray) -> list[FloatArray]:
        """(..., G) probability of each next state that transitions determine, by local model."""
        discount = self.problem.mdp.discount
        found = []
        for row, groups in distinct_rows(self.problem):
            share = np.stack([table[..., row, groups == g].sum(axis=-1) for g in set(groups)], -1)
            if self._timed:  # what discounting takes away counts as an outcome
                ended = discount * share
                share = np.concatenate([ended, 1.0 - ended.sum(axis=-1, keepdims=True)], axis=-1)
            found.append(np.maximum(share, 1e-300))
        return found

    def _coverage(self, result: Arrays) -> dict[str, float]:
        """Shares of true weights and of true probabilities within their intervals."""
        found = {}
        if self.weights is not None and "draws_weights" in result:
            stated = ~np.asarray(result.get("unstated", np.zeros(len(self.weights), bool)))
            found["weights without interval"] = float(np.mean(~stated))
            if stated.any():
                drawn = result["draws_weights"][:, stated]
                found["coverage of weights"] = _held(drawn, self.weights[stated])
        if self.truth is not None and "draws_table" in result:
            drawn, true = self._shares(result["draws_table"]), self._shares(self.truth)
            together = [np.concatenate(each, axis=-1) for each in (drawn, true)]
            found["coverage of probabilities"] = _held(*together)
        return found


_MODELS = ("successors", "model_of", "available")


def _held(draws: FloatArray, truth: FloatArray) -> float:
    low, high = np.quantile(draws, ENDS, axis=0)
    return float(np.mean((low <= truth) & (truth <= high)))


def distinct_rows(problem: TabularProblem) -> Iterator[tuple[int, IntArray]]:
    """Each row of the table with the outcomes that lead to one state: (K,) numbers of groups.

    A row is met once for every pattern of shared successors, and not where all outcomes lead to one
    state.
    """
    models = problem.mdp.transitions
    assert isinstance(models, OutcomeModels)
    same = models.successors[..., :, None] == models.successors[..., None, :]
    first = same.argmax(axis=-1)[models.available]
    keys = np.column_stack([models.model_of[models.available], first])
    for row, *groups in np.unique(keys, axis=0).tolist():
        if len(set(groups)) > 1:
            yield row, np.array(groups)


def decision_shares(problem: TabularProblem, decisions: Decisions) -> FloatArray:
    """(S, A) share of each decision among those of a table."""
    return np.asarray(observe(problem, decisions).state_action / len(decisions))


@dataclass(frozen=True, eq=False)
class RouteCase:
    """Trips on a network to many destinations without a discount, and others to predict."""

    network: RouteNetwork
    trips: Trips
    held_out: Trips

    def given(self) -> Arrays:
        """What a method is given, which is no problem with one goal."""
        names, found = ("n_links", "from_link", "to_link", "features", "exits"), dict[str, Any]()
        found |= {f"network_{name}": getattr(self.network, name) for name in names}
        of_trips = ("origin", "destinations", "to", "features")
        return found | {f"trips_{name}": getattr(self.trips, name) for name in of_trips}

    def scores(self, result: Arrays) -> dict[str, float]:
        """Log-likelihood per trip of those held out."""
        value = RouteLikelihood(self.network, self.held_out).evaluate(result["weights"])[0]
        return {"log-likelihood": float(value) / len(self.held_out)}
