"""Sweeps of Metropolis steps, which turn draws near a posterior into draws of the posterior itself.

At a wall several outcomes of a model lead to one cell, so transitions inform about a sum of their
probabilities. With n_E transitions that a set E of outcomes explains, the posterior is

    p(w, P | D)  ~  prod_m [ Dirichlet(P_m; c_m) prod_E (sum_{k in E} P_m(k))^n_mE ]  N(w) L(w, P)

with L the likelihood of choices and N all priors but the Dirichlet densities. A block of outcomes
whose prior is another counts as weights w. Let L^ be close to L (`serd_core.bayes.surrogate`) and
p^ be p with L^ for L. A sweep takes the following steps in random order, each with the probability
min(1, ratio), and leaves p^ as it is (docs/evidence.md has the reasons):

    outcomes of a model   x_E ~ Multinomial(n_E, P_k / sum_E P),   P' ~ Dirichlet(c_m + sum_E x_E),
                          with probability 7/10 w' = w + A (P' - P);    ratio (N L^)' / (N L^)
    weights               w' = w + a normal step;                       ratio (N L^)' / (N L^)
    one weight            w' = w + a normal step of any length;         ratio (N L^)' / (N L^)
    log odds of a model   energies and a normal step;                   ratio p^' / p^
    law of dwell times    its mean or shape ~ N given all others;       ratio L^' / L^

The counts x complete the transitions (Tanner and Wong 1987); A is the slope of w by P_m in
Laplace's approximation. A sweep from x to y is taken with the probability
min(1, (L / L^)(y) / (L / L^)(x)), which leaves p as it is (surrogate transitions: Liu 2001) and
costs one solution of Bellman's equation. Then a step of one weight and another step are taken with
L itself, as L^ is wrong far from the mode, where weights that few choices bound go: the length of a
step of one weight is drawn between the width of Laplace's approximation, given all other numbers,
and that of the prior. Where actions are hidden, a sweep starts with a draw of them.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from serd_core.arrays import BoolArray, FloatArray, IntArray
from serd_core.bayes.hyperpriors import BaseMeasures, log_dirichlet_density
from serd_core.bayes.surrogate import ExactPart, OutcomeGroup, Surrogate
from serd_core.dynamics.estimation import OutcomeSets, outcome_sets
from serd_core.dynamics.outcome_models import OutcomeModels
from serd_core.dynamics.transition_model import transitions_of
from serd_core.errors import SerdError
from serd_core.posterior.coordinates import Coordinates
from serd_core.posterior.parameters import Block
from serd_core.posterior.posterior import Posterior, drawn_actions

#: Sweeps before the first draws.
N_SWEEPS = 5
#: Probability that weights move with the outcomes of a model.
SHIFTED = 0.7
#: Steps of the weights in a sweep, and as many of weights and laws together; they cost little.
N_WALKS = 3
#: Length of normal steps in conditional standard deviations, times the root of their number.
STRIDE = 2.38
#: Least logarithm of a probability.
LEAST_LOG = -690.0
#: Share of the largest eigenvalue below which another one is 0.
ZERO = 1e-10
#: Sweeps of all chains together of which one must be accepted.
ENOUGH = 50


def can_sweep(posterior: Posterior, space: Coordinates) -> bool:
    """Whether outcome models are learned, whose posterior sweeps keep."""
    moves = posterior.problem.mdp.transitions.moves
    return isinstance(moves, OutcomeModels) and space.belief.learns_dynamics


@dataclass(frozen=True, eq=False)
class _Walk:
    """Normal steps of r free numbers: their places (r,), and the root (r, r) of the covariance."""

    rows: IntArray
    root: FloatArray

    def step(self, points: FloatArray, rng: np.random.Generator) -> FloatArray:
        """(n, m) points after a step of each."""
        moved = points.copy()
        moved[:, self.rows] += rng.standard_normal((len(points), len(self.rows))) @ self.root.T
        return moved


@dataclass(frozen=True, eq=False)
class _Model:
    """One outcome model of a group, the number of that, and what transitions inform about it.

    sets: (g,) places of the sets E; explaining: (g, K) masks; slope: (r, K) A; walk: of log odds.
    """

    group: OutcomeGroup
    of_group: int
    number: int
    sets: IntArray
    explaining: FloatArray
    slope: FloatArray
    walk: _Walk

    @property
    def has_counts(self) -> bool:
        """Whether the prior of the model is a Dirichlet density."""
        return bool(self.group.pseudo_counts[self.number].any())

    def of_sets(self, log_outcomes: FloatArray) -> FloatArray:
        """(n, g, K) log P of (n, K) where an outcome is in a set, elsewhere -inf."""
        return np.where(self.explaining > 0, log_outcomes[:, None], -np.inf)


class Chains:
    """n chains at (n, m) points, which take the same steps in the same order.

    counts: (n, p) of the observed pairs, set_counts: (n, G) of the sets of outcomes, which differ
    where actions are hidden; log_near: (n,) log N L^; exact: N and L where the last sweep ended.
    """

    def __init__(
        self,
        near: Surrogate,
        root: FloatArray,
        start: FloatArray,
        rng: np.random.Generator,
        *,
        learned_counts: bool = False,
    ) -> None:
        seen, n = near.posterior.observations, len(start)
        sets = outcome_sets(near.model, seen)
        precision = _precision(near.space, root)
        self.near, self.rng, self.points = near, rng, start @ near.space.table.T
        self.counts = np.tile(seen.state_action.ravel()[near.pairs], (n, 1))
        self.set_counts = np.tile(sets.count, (n, 1))
        # Free numbers that are reward weights, or outcomes that have another prior.
        self.shifted = np.ones(len(near.mode), dtype=np.bool_)
        for group in near.groups:
            self.shifted[group.place.start : group.laws.start] = not group.pseudo_counts.any()
        self.models = _models(near, root, precision, sets, self.shifted)
        self.pseudo_counts = [
            np.tile(group.pseudo_counts, (n, 1, 1)) if group.pseudo_counts.any() else np.zeros(1)
            for group in near.groups
        ]
        self.bases = {
            of_group: BaseMeasures.of(near.model, float(group.pseudo_counts[0, 0]), n)
            for of_group, group in enumerate(near.groups)
            if learned_counts and group.pseudo_counts.any() and not np.ptp(group.pseudo_counts)
        }
        laws = [np.arange(group.laws.start, group.laws.stop) for group in near.groups]
        self.laws = [row for row in np.concatenate(laws).tolist() if near.hessian[row, row] < 0]
        weights = np.arange(len(near.space.like.reward))
        self.walks = [_walk(near.space, precision, weights)] * N_WALKS
        self.reached = np.concatenate([weights, np.array(self.laws, dtype=np.int64)])
        narrow = near.space.units()[self.reached] / np.sqrt(np.diag(precision)[self.reached])
        self.lengths = np.log([narrow, near.of_prior[self.reached] ** -0.5])
        if self.laws:
            both = np.concatenate([weights, *laws])
            self.walks += [_walk(near.space, precision, both)] * N_WALKS
        self.exact = near.exact(self.points, np.tile(near.value, (n, 1)))
        self.log_near = self._log_near(self.points)
        self.n_proposed = self.n_accepted = 0
        self.direct = False
        for _ in range(N_SWEEPS - 1):
            self.sweep()

    def states(self, n: int) -> tuple[FloatArray, FloatArray]:
        """(n c, d) coordinates of the c chains after each of the next n sweeps.

        And (n c, M, K) pseudo-counts of the prior of the true outcomes.
        """
        truth = self.near.groups.index(self.near.group_of(Block.TRUTH))
        found, counts = list[FloatArray](), list[FloatArray]()
        for _ in range(n):
            self.sweep()
            found.append(self.near.space.of_free(self.points))
            counts.append(np.broadcast_to(self.pseudo_counts[truth], self._shape))
        self._require_accepted()
        return np.concatenate(found), np.concatenate(counts)

    @property
    def _shape(self) -> tuple[int, int, int]:
        return len(self.points), self.near.model.n_models, self.near.model.n_outcomes

    def sweep(self) -> None:
        """Take all steps in random order, and all of them back where the sweep is not accepted."""
        if self.near.posterior.observations.hidden:
            self._draw_actions()
        steps: list[Callable[[], None]] = [partial(self._walk, each) for each in self.walks]
        steps.append(self._reach)
        for model in self.models:
            steps.append(partial(self._walk_outcomes, model))
            if model.has_counts:
                steps.append(partial(self._redraw_outcomes, model))
        steps += [partial(self._redraw_law, row) for row in self.laws]
        for of_group in self.bases:
            steps += [partial(self._walk_base, of_group)] * N_WALKS
            steps.append(partial(self._redraw_unseen, of_group))
        points, log_near, bases = self.points, self.log_near, self.bases.copy()
        for number in self.rng.permutation(len(steps)):
            steps[number]()
        there = self.near.exact(self.points, self.exact.values)
        gained = self._log_exact(there) - self._log_exact(self.exact)
        taken = self._taken(gained - (self.log_near - log_near))
        self.points = np.where(taken[:, None], self.points, points)
        self.log_near = np.where(taken, self.log_near, log_near)
        for of_group, base in bases.items():
            self._take_base(of_group, ~taken, base)
        self.exact = self.exact.replaced(taken, there)
        self.n_proposed += len(taken)
        self.n_accepted += int(taken.sum())
        self.direct = True
        self._reach()
        self._leap()
        steps[self.rng.integers(len(steps))]()
        self.direct = False

    def _require_accepted(self) -> None:
        """SerdError where many sweeps were proposed and none accepted."""
        if self.n_proposed >= ENOUGH and not self.n_accepted:
            raise SerdError(
                "chains that start at draws of Laplace's approximation must move, but none of"
                f" {self.n_proposed} sweeps was accepted; take a stronger prior"
            )

    def _log_near(self, points: FloatArray) -> FloatArray:
        choices = np.sum(self.counts * self.near.log_policy(points), axis=1)
        return np.asarray(choices + self.near.log_others(points))

    def _log_exact(self, at: ExactPart) -> FloatArray:
        """(n,) log N L."""
        return np.asarray(np.sum(self.counts * at.log_policy, axis=1) + at.log_others)

    def _taken(self, log_ratio: FloatArray) -> BoolArray:
        """(n,) whether steps of these log ratios are taken."""
        return np.asarray(np.log(self.rng.random(len(log_ratio))) < log_ratio)

    def _step(self, moved: FloatArray, log_ratio: FloatArray | float = 0.0) -> BoolArray:
        """Go to the moved points where N L^, or directly N L, and the rest of the ratio, allow."""
        log_near = self._log_near(moved)
        if self.direct:
            there = self.near.exact(moved, self.exact.values)
            gained = self._log_exact(there) - self._log_exact(self.exact)
            taken = self._taken(gained + log_ratio)
            self.points = np.where(taken[:, None], moved, self.points)
            self.log_near = np.where(taken, log_near, self.log_near)
            self.exact = self.exact.replaced(taken, there)
            return taken
        taken = self._taken(log_near - self.log_near + log_ratio)
        self.points = np.where(taken[:, None], moved, self.points)
        self.log_near = np.where(taken, log_near, self.log_near)
        return taken

    def _walk(self, walk: _Walk) -> None:
        self._step(walk.step(self.points, self.rng))

    def _reach(self) -> None:
        """Move one weight or law of each chain by any length up to the width of its prior."""
        self._step(self._reached())

    def _leap(self) -> None:
        """The same, or a weight mirrored, with outcomes of some models redrawn."""
        rows, moved = np.arange(len(self.points)), self._reached()
        weight = self.rng.integers(len(self.near.space.like.reward), size=len(rows))
        mirrored, share = self.rng.random(len(rows)) < 0.5, self.rng.random(len(rows))
        moved[mirrored] = self.points[mirrored]
        moved[rows, weight] *= np.where(mirrored, -1.0, 1.0)
        for model in self.models:
            if model.has_counts:
                taken = self.rng.random(len(rows)) < share
                energies = self._completed(model) / self.near.model.beta
                there = moved[:, model.walk.rows]
                moved[:, model.walk.rows] = np.where(taken[:, None], energies, there)
        self._step(moved)

    def _reached(self) -> FloatArray:
        """(n, m) points after a step of one number of each chain."""
        rows, moved = np.arange(len(self.points)), self.points.copy()
        number = self.rng.integers(len(self.reached), size=len(rows))
        shortest, longest = self.lengths[:, number]
        length = STRIDE * np.exp(shortest + self.rng.random(len(rows)) * (longest - shortest))
        moved[rows, self.reached[number]] += length * self.rng.standard_normal(len(rows))
        return moved

    def _redraw_outcomes(self, model: _Model) -> None:
        moved = self.points.copy()
        self._put_outcomes(moved, model, self._completed(model))
        self._step(moved)

    def _completed(self, model: _Model) -> FloatArray:
        """(n, K) log outcomes of one model, drawn given its moves, which the present ones share."""
        logs = self.near.log_outcomes(self.points, model.group)[:, model.number]
        of_sets = model.of_sets(logs)
        shares = np.exp(of_sets - np.logaddexp.reduce(of_sets, axis=2, keepdims=True))
        counts = self.set_counts[:, model.sets].astype(np.int64)
        completed = self.rng.multinomial(counts, shares).sum(axis=1)
        return self._log_dirichlet(self._counts_of(model) + completed)

    def _walk_base(self, of_group: int) -> None:
        """Move the pseudo-counts of a group under its outcomes, whatever the choices."""
        there = self.bases[of_group].moved(self.rng)
        every = np.ones(self.near.model.n_models, dtype=np.bool_)
        self._take_base(of_group, self._taken(self._log_base_ratio(of_group, there, every)), there)

    def _redraw_unseen(self, of_group: int) -> None:
        """Move the pseudo-counts of a group with the models of which no move was observed."""
        there = self.bases[of_group].moved(self.rng)
        moved, seen = self.points.copy(), np.ones(self.near.model.n_models, dtype=np.bool_)
        for model in self.models:
            if model.of_group == of_group and not len(model.sets):
                seen[model.number] = False
                drawn = self._log_dirichlet(there.pseudo_counts[:, model.number])
                self._put_outcomes(moved, model, drawn)
        if not seen.all():
            taken = self._step(moved, self._log_base_ratio(of_group, there, seen))
            self._take_base(of_group, taken, there)

    def _log_base_ratio(self, of_group: int, there: BaseMeasures, models: BoolArray) -> FloatArray:
        """(n,) log density of others with the outcomes of some models, less that of the present."""
        logs = self.near.log_outcomes(self.points, self.near.groups[of_group])[:, models]
        after, before = there.pseudo_counts[:, models], self.pseudo_counts[of_group][:, models]
        found = there.log_density() - self.bases[of_group].log_density()
        found += log_dirichlet_density(logs, after) - log_dirichlet_density(logs, before)
        return np.asarray(found)

    def _take_base(self, of_group: int, rows: BoolArray, base: BaseMeasures) -> None:
        self.bases[of_group] = self.bases[of_group].replaced(rows, base)
        self.pseudo_counts[of_group] = self.bases[of_group].pseudo_counts

    def _put_outcomes(self, moved: FloatArray, model: _Model, drawn: FloatArray) -> None:
        """Put (n, K) log probabilities into points (n, m), with probability 0.7 weights too."""
        logs = self.near.log_outcomes(moved, model.group)[:, model.number]
        moved[:, model.walk.rows] = drawn / self.near.model.beta
        shift = (np.exp(drawn) - np.exp(logs)) @ model.slope.T
        moved[:, self.shifted] += np.where(self.rng.random((len(moved), 1)) < SHIFTED, shift, 0.0)

    def _log_dirichlet(self, shapes: FloatArray) -> FloatArray:
        """(n, K) logarithms of draws, which are finite for shapes far below 1, too."""
        log_gamma = np.log(self.rng.standard_gamma(shapes + 1.0))
        log_gamma += np.log(self.rng.random(shapes.shape)) / shapes
        logs = log_gamma - np.logaddexp.reduce(log_gamma, axis=1, keepdims=True)
        return np.asarray(np.maximum(logs, LEAST_LOG))

    def _redraw_law(self, row: int) -> None:
        near, moved = self.near, self.points.copy()
        bend = near.hessian[row, row]
        slope = near.gradient[row] + (self.points - near.mode) @ near.hessian[row]
        moved[:, row] += self.rng.standard_normal(len(moved)) / np.sqrt(-bend) - slope / bend
        self._step(moved, near.log_others(self.points) - near.log_others(moved))

    def _walk_outcomes(self, model: _Model) -> None:
        moved = model.walk.step(self.points, self.rng)
        self._step(moved, self._log_outcomes(moved, model) - self._log_outcomes(self.points, model))

    def _log_outcomes(self, points: FloatArray, model: _Model) -> FloatArray:
        """(n,) log density of the transitions and the Dirichlet prior of one model."""
        logs = self.near.log_outcomes(points, model.group)[:, model.number]
        observed = self.set_counts[:, model.sets] * np.logaddexp.reduce(model.of_sets(logs), axis=2)
        return np.asarray(observed.sum(axis=1) + np.sum(logs * self._counts_of(model), axis=1))

    def _counts_of(self, model: _Model) -> FloatArray:
        """(n, K) pseudo-counts of a model, 0 where its prior is no Dirichlet density."""
        counts = self.pseudo_counts[model.of_group]
        return counts[:, model.number] if model.has_counts else np.zeros((1, 1))

    def _draw_actions(self) -> None:
        """Complete the counts of each chain by a draw of the hidden actions."""
        near, seen = self.near, self.near.posterior.observations
        tables = np.exp(near.log_outcomes(self.points, near.group_of(Block.TRUTH)))
        for number, table in enumerate(tables):
            log_policy = np.zeros(seen.state_action.shape)
            log_policy.flat[near.pairs] = self.exact.log_policy[number]
            true = transitions_of(near.model, table)
            complete = drawn_actions(seen, log_policy, true, self.rng)
            self.counts[number] = complete.state_action.ravel()[near.pairs]
            self.set_counts[number] = outcome_sets(near.model, complete).count
        self.log_near = self._log_near(self.points)


def _models(
    near: Surrogate,
    root: FloatArray,
    precision: FloatArray,
    sets: OutcomeSets,
    shifted: BoolArray,
) -> tuple[_Model, ...]:
    spread, found = near.space.table @ root, list[_Model]()
    if near.model.n_outcomes == 1:
        return ()
    for of_group, group in enumerate(near.groups):
        for number, log_p in enumerate(near.log_outcomes(near.mode[None], group)[0]):
            rows = near.rows_of(group, number)
            informed = Block.TRUTH in group.blocks
            mine = np.flatnonzero((sets.model == number) & informed)
            slope = _slope(spread[shifted], near.model.beta * spread[rows], np.exp(log_p))
            walk = _walk(near.space, precision, rows)
            found.append(_Model(group, of_group, number, mine, sets.explaining[mine], slope, walk))
    return tuple(found)


def _precision(space: Coordinates, root: FloatArray) -> FloatArray:
    """(m, m) inverse covariance of the free numbers in their units, 0 along the gauge."""
    half = space.of_free(np.diag(space.units())) @ np.linalg.inv(root).T
    return np.asarray(half @ half.T)


def _walk(space: Coordinates, precision: FloatArray, rows: IntArray) -> _Walk:
    """Steps in proportion to the covariance of (r,) numbers given all others."""
    values, vectors = np.linalg.eigh(precision[np.ix_(rows, rows)])
    kept = values > ZERO * values[-1]
    inverse = vectors[:, kept] / np.sqrt(values[kept]) @ vectors[:, kept].T
    return _Walk(rows, STRIDE / np.sqrt(kept.sum()) * space.units()[rows, None] * inverse)


def _slope(spread: FloatArray, energies: FloatArray, table: FloatArray) -> FloatArray:
    """(r, K) regression of r numbers on (K,) probabilities, by (r, d) and (K, d) roots."""
    moved = table[:, None] * (energies - table @ energies)
    return np.asarray(spread @ moved.T @ np.linalg.pinv(moved @ moved.T, ZERO, hermitian=True))
