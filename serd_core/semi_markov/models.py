"""Outcome models whose moves take time: the transition model of a semi-Markov decision process.

    K_m(k) = P_m(k) E[gamma^tau | m, k],    Q(s, a) = R(s, a) + sum_k K_m(k) V(s')

gamma is per second. With gamma taken out of K, this is the Bellman equation of the other models:

    Q(s, a) = R(s, a) + gamma sum_k e_m(k) V(s'),    e_m(k) = P_m(k) E[gamma^(tau - 1)]

The local probabilities are the table e, whose rows need not sum to 1; where every move takes one
second it is P. docs/semi_markov.md has an example. The parameters are the energies of the
outcomes, then the log mean (s) of each law of dwell times, then the log shape of each.

Some durations are given instead: a decision takes one second in states that nothing leaves, and
where its model has no law; and it may end in its own state after a given time without a move. So a
row of the table is a local model with the outcomes that stay, and a pace that moves its log means.
"""

from dataclasses import dataclass, is_dataclass, replace
from functools import cached_property
from typing import NamedTuple, TypeVar

import numpy as np

from serd_core.arrays import FloatArray, IntArray, first_index, weighted_counts
from serd_core.checks import float_array, int_array, require_each, require_kind, require_positive
from serd_core.dynamics.outcome_models import OutcomeModels
from serd_core.dynamics.transition_model import TransitionModel
from serd_core.errors import SerdError
from serd_core.mdp.mdp import Mdp
from serd_core.mdp.problem import Problem, require_problem
from serd_core.semi_markov.gamma_law import ByMeanAndShape, log_discount

#: Law of models whose decisions take a given time.
NO_LAW = -1
P = TypeVar("P", bound=Problem)


class DwellLaws(NamedTuple):
    """(..., R, K) outcome probabilities, mean dwell times and shapes, inf of given durations.

    Those of action a in state s are in row `model_of[s, a]`.
    """

    probability: FloatArray
    mean_s: FloatArray
    shape: FloatArray


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class SemiMarkovModels(OutcomeModels):
    """R rows of M outcome models whose moves take times of D gamma laws.

    outcomes: the M models; discount: gamma per second, that of the Mdp. law_of: (M, K) law of each
    outcome, `NO_LAW` where the model has none; stay_s: (M,) seconds after which a decision ends
    in its own state, 0 where that has a law, too; without a law every decision takes so long, or
    one second where it is 0. row_model, log_pace: (R,) model of each row, and
    what its log means are moved by; given_s: (R, K) given durations, 0 where there is a law.
    """

    outcomes: OutcomeModels
    discount: float
    law_of: IntArray
    stay_s: FloatArray
    row_model: IntArray
    log_pace: FloatArray
    given_s: FloatArray

    @property
    def moves(self) -> OutcomeModels:
        return self.outcomes

    @property
    def n_laws(self) -> int:
        """Number of laws D."""
        return self.outcomes.n_others // 2

    @property
    def n_parameters(self) -> int:
        """M * K energies, D log means and D log shapes."""
        return self.outcomes.n_parameters

    @cached_property
    def means(self) -> slice:
        """Place of the log means in the parameter vector."""
        return slice(self.outcomes.n_energies, self.outcomes.n_energies + self.n_laws)

    @cached_property
    def shapes(self) -> slice:
        """Place of the log shapes in the parameter vector."""
        return slice(self.means.stop, self.n_parameters)

    @property
    def parameter_names(self) -> tuple[str, ...]:
        kinds = ("mean", "shape of")
        laws = [f"log {name} dwell {law}" for name in kinds for law in range(self.n_laws)]
        return (*self.outcomes.parameter_names, *laws)

    @property
    def gauge(self) -> FloatArray:
        return self.outcomes.gauge

    @cached_property
    def log_longest_s(self) -> FloatArray:
        """(D,) log seconds after which a decision without a move ends; inf where it does not."""
        longest, has_law = np.zeros(self.n_laws), self.law_of >= 0
        stay_s = np.broadcast_to(self.stay_s[:, None], has_law.shape)
        np.maximum.at(longest, self.law_of[has_law], stay_s[has_law])
        return np.log(np.where(longest > 0, longest, np.inf))

    @cached_property
    def row_law(self) -> IntArray:
        """(R, K) law of each number of the table, -1 where the duration is given."""
        return np.where(self.given_s > 0, -1, self.law_of[self.row_model])

    @cached_property
    def _place(self) -> IntArray:
        """(C,) place in the flat table of each number that has a law."""
        return np.flatnonzero(self.row_law >= 0)

    @cached_property
    def _columns(self) -> tuple[IntArray, IntArray]:
        """(C,) place in the parameter vector of the log mean and log shape of each of these."""
        law = self.row_law.ravel()[self._place]
        return self.means.start + law, self.shapes.start + law

    def local_probabilities(self, parameters: FloatArray) -> FloatArray:
        """(..., R, K) table e for (..., N) parameters."""
        table = self.outcomes.local_probabilities(parameters)[..., self.row_model, :]
        factor = self._factor(self._log_factor(np.asarray(parameters)))
        return np.asarray(table * factor.reshape(table.shape))

    def laws(self, parameters: FloatArray) -> DwellLaws:
        """Outcomes and dwell times of each row for (..., N) parameters."""
        theta = np.asarray(parameters)
        probability = self.outcomes.local_probabilities(theta)[..., self.row_model, :]
        log_means, log_shapes = theta[..., self.means], theta[..., self.shapes]
        if not self.n_laws:
            log_means = log_shapes = np.zeros((*theta.shape[:-1], 1))
        given = self.row_law < 0
        mean_s = np.exp(log_means[..., self.row_law] + self.log_pace[:, None])
        return DwellLaws(
            probability=probability,
            mean_s=np.where(given, self.given_s, mean_s),
            shape=np.where(given, np.inf, np.exp(log_shapes[..., self.row_law])),
        )

    def _log_factor(self, parameters: FloatArray) -> ByMeanAndShape:
        """log E[gamma^(tau - 1)] of the numbers that have a law."""
        mean, shape = (parameters[..., columns] for columns in self._columns)
        rate = -float(np.log(self.discount))
        found = log_discount(mean + self.log_pace[self._place // self.n_outcomes], shape, rate)
        return found._replace(value=found.value + rate)

    def _factor(self, log_factor: ByMeanAndShape) -> FloatArray:
        """(..., R*K) E[gamma^(tau - 1)] of all numbers."""
        given = np.exp(np.log(self.discount) * (self.given_s.ravel() - 1.0))
        factor = np.broadcast_to(given, (*log_factor.value.shape[:-1], given.size)).copy()
        factor[..., self._place] = np.exp(log_factor.value)
        return factor

    def pull_back(self, parameters: FloatArray, local_gradient: FloatArray) -> FloatArray:
        by_outcome, timed, factor = self._split(parameters, local_gradient)
        found = self.outcomes.pull_back(parameters, by_outcome)
        for column, slope in zip(self._columns, (factor.mean, factor.shape), strict=True):
            found += weighted_counts(column, timed * slope, self.n_parameters)
        return found

    def _split(
        self, parameters: FloatArray, local_gradient: FloatArray
    ) -> tuple[FloatArray, FloatArray, ByMeanAndShape]:
        """(M, K) gradient by probabilities, (C,) gradient by the log factors, and these."""
        log_factor = self._log_factor(parameters)
        weight = np.ravel(local_gradient) * self._factor(log_factor)
        by_outcome = np.zeros((self.outcomes.n_models, self.n_outcomes))
        np.add.at(by_outcome, self.row_model, weight.reshape(-1, self.n_outcomes))
        table = self.outcomes.local_probabilities(parameters)[self.row_model].ravel()
        return by_outcome, weight[self._place] * table[self._place], log_factor

    def local_jacobian(self, parameters: FloatArray) -> FloatArray:
        log_factor, place = self._log_factor(parameters), self._place
        found = self._factor(log_factor)[:, None] * self._outcome_slopes(parameters)
        value = self.local_probabilities(parameters).ravel()[place]
        for column, slope in zip(self._columns, (log_factor.mean, log_factor.shape), strict=True):
            found[place, column] += value * slope
        return found

    def _outcome_slopes(self, parameters: FloatArray) -> FloatArray:
        """(R*K, N) derivative of the probability in each number of the table."""
        slopes = self.outcomes.local_jacobian(parameters)
        by_model = slopes.reshape(self.outcomes.n_models, self.n_outcomes, -1)
        return np.asarray(by_model[self.row_model].reshape(-1, self.n_parameters))

    def local_curvature(self, parameters: FloatArray, local_gradient: FloatArray) -> FloatArray:
        by_outcome, timed, factor = self._split(parameters, local_gradient)
        found = self.outcomes.local_curvature(parameters, by_outcome)
        mean, shape = self._columns
        # Numbers with laws: d2 (P F) = F d2 P + dP dF + dF dP + P d2 F, the first above.
        slopes = self._outcome_slopes(parameters)[self._place]
        weight = np.ravel(local_gradient)[self._place] * np.exp(factor.value)
        mixed = np.zeros_like(found)
        np.add.at(mixed, mean, (weight * factor.mean)[:, None] * slopes)
        np.add.at(mixed, shape, (weight * factor.shape)[:, None] * slopes)
        np.add.at(mixed, (mean, shape), timed * (factor.mean * factor.shape + factor.mean_shape))
        found += mixed + mixed.T
        np.add.at(found, (mean, mean), timed * (factor.mean**2 + factor.mean_mean))
        np.add.at(found, (shape, shape), timed * (factor.shape**2 + factor.shape_shape))
        return found

    def parameters_of(self, initial: FloatArray) -> FloatArray:
        """(N,) the parameters themselves, checked; `parameters_from` makes them."""
        return float_array("dynamics", initial, (self.n_parameters,))

    fixed_parameters_of = TransitionModel.fixed_parameters_of
    known_probabilities = TransitionModel.known_probabilities

    def parameters_from(
        self,
        outcome_probabilities: FloatArray,
        mean_s: FloatArray | float,
        shape: FloatArray | float,
    ) -> FloatArray:
        """(N,) parameters of (M, K) probabilities, and mean and shape of all or each (D,) law."""
        found = [self.outcomes.fixed_parameters_of(outcome_probabilities)[: self.means.start]]
        for name, given in (("mean_s", mean_s), ("shape", shape)):
            of_all = np.full(self.n_laws, given) if np.ndim(given) == 0 else given
            values = float_array(name, of_all, (self.n_laws,))
            require_each(name, values, values > 0, "be above 0", "use for example 1")
            found.append(np.log(values))
        return np.concatenate(found)

    def expected_seconds(self, parameters: FloatArray) -> FloatArray:
        """(S, A) mean dwell time of (N,) parameters; 0 where an action is not available."""
        laws = self.laws(parameters)
        by_row = np.sum(laws.probability * laws.mean_s, axis=1)
        return np.where(self.available, by_row[self.model_of], 0.0)

    def require_discount(self, discount: float) -> None:
        if discount != self.discount:
            raise SerdError(
                f"discount of the Mdp must be that of its dwell times, {self.discount} per second,"
                f" got {discount}; use semi_markov_problem"
            )

    @cached_property
    def _is_timeless(self) -> bool:
        """Whether each move takes one second, so that the table is P."""
        return bool(np.all(self.given_s == 1.0))

    def largest_sum(self, local_probabilities: FloatArray) -> float:
        return 1.0 if self._is_timeless else float(np.sum(local_probabilities, axis=1).max())

    def require_transitions(self, local_probabilities: FloatArray) -> None:
        """SerdError unless all numbers are discounted probabilities: sum_k K below 1."""
        if self._is_timeless:
            super().require_transitions(local_probabilities)
            return
        self._require_table(local_probabilities)
        sums = self.discount * np.sum(local_probabilities, axis=1)
        good = (np.asarray(local_probabilities) >= 0).all(axis=1) & (sums < 1.0)
        if (row := first_index(~good)) is not None:
            raise SerdError(
                f"discounted outcomes of row {row[0]} must not be negative and sum to less than"
                f" 1 / discount, got a sum of {sums[row[0]] / self.discount:.6g}; use longer mean"
                " dwell times"
            )


def semi_markov_problem(
    problem: P,
    *,
    law_of: IntArray | None = None,
    stay_s: FloatArray | float | None = None,
    log_pace: FloatArray | None = None,
) -> P:
    """Make a problem whose moves take time from one of decisions; its discount is then per second.

    law_of: (M, K) gamma law of each outcome, from 0, or -1 for whole models, whose decisions all
    take stay_s, or one second where that is not given; None for one law per model that a state
    uses which some action leaves. stay_s: seconds after which a decision without a move ends in its
    own state, of all or of each (M,) model; None where staying has the law of its outcome.
    log_pace: (S,) by which the log means of each state are moved; None for 0. A problem that has
    dwell times keeps laws and stay_s that are not given. SerdError where a part is of another kind
    or shape. Fits, policies and posteriors take the result like other problems:

        timed = sc.semi_markov_problem(problem, stay_s=4.0)
        fit = sc.fit_mdce_serd(timed, decisions)      # TimedDecisions
        laws = timed.mdp.transitions.laws(fit.parameters.truth)
        print(laws.mean_s[timed.mdp.transitions.model_of[state, action]])
    """
    require_problem(problem)
    if not is_dataclass(problem):
        raise SerdError(
            f"problem must be a dataclass with an mdp, got a {type(problem).__name__}; use for"
            " example a TabularProblem"
        )
    model, discount = problem.mdp.transitions, problem.mdp.discount
    if isinstance(model, SemiMarkovModels):
        law_of = model.law_of if law_of is None else law_of
        stay_s = model.stay_s if stay_s is None else stay_s
        model = model.outcomes
    require_kind("problem.mdp.transitions", model, (OutcomeModels,), "OutcomeModels(...)")
    require_positive("discount", discount, "use for example 0.97 per second")
    laws = _laws(model, law_of)
    stays = np.broadcast_to(0.0 if stay_s is None else stay_s, (model.n_models,))
    stays = float_array("stay_s", stays, (model.n_models,))
    require_each("stay_s", stays, stays >= 0, "not be negative", "use 0 where staying has a law")
    pace = np.zeros(model.n_states) if log_pace is None else log_pace
    outcomes = replace(model, n_others=2 * (int(laws.max()) + 1))
    rows, row_of = _rows(model, laws, stays, float_array("log_pace", pace, (model.n_states,)))
    models = SemiMarkovModels(
        successors=model.successors,
        model_of=row_of,
        available=model.available,
        n_models=len(rows),
        beta=model.beta,
        outcomes=outcomes,
        discount=discount,
        law_of=laws,
        stay_s=stays,
        row_model=rows[:, 0].astype(np.int64),
        log_pace=rows[:, 1],
        given_s=rows[:, 2:],
    )
    return replace(problem, mdp=Mdp(models, discount))


def _laws(outcomes: OutcomeModels, law_of: IntArray | None) -> IntArray:
    """(M, K) checked laws."""
    if law_of is None:
        moving = outcomes.available & ~outcomes.absorbing[:, None]
        used = np.unique(outcomes.model_of[moving])
        by_model = np.full(outcomes.n_models, NO_LAW)
        by_model[used] = np.arange(len(used))
        return np.asarray(np.repeat(by_model[:, None], outcomes.n_outcomes, axis=1))
    laws = int_array("law_of", law_of, (outcomes.n_models, outcomes.n_outcomes))
    require_each("law_of", laws, laws >= NO_LAW, "be a law or -1", "number laws from 0")
    known = laws == NO_LAW
    mixed = known.any(axis=1) & ~known.all(axis=1)
    fix = "give each outcome of that model a law, or none of them"
    require_each("law_of", laws[:, 0], ~mixed, "be -1 for all outcomes of a model or none", fix)
    used = np.unique(laws[~known])
    if not np.array_equal(used, np.arange(len(used))):
        raise SerdError(f"law_of must number its laws 0, 1, ..., got {used.tolist()}; close gaps")
    return laws


def _rows(
    outcomes: OutcomeModels, laws: IntArray, stay_s: FloatArray, log_pace: FloatArray
) -> tuple[FloatArray, IntArray]:
    """(R, 2 + K) model, pace and given seconds of each row, and (S, A) row of each pair."""
    model = np.where(outcomes.available, outcomes.model_of, 0)
    stays = outcomes.successors == np.arange(outcomes.n_states)[:, None, None]
    given = np.where(stays, stay_s[model][..., None], 0.0)
    without = laws[model, 0] == NO_LAW
    given[without] = np.where(stay_s > 0, stay_s, 1.0)[model[without], None]
    given[np.broadcast_to(outcomes.absorbing[:, None], model.shape)] = 1.0
    has_law = np.any(given == 0.0, axis=2)
    pace = np.where(has_law, log_pace[:, None], 0.0)
    columns = np.concatenate([np.stack([model, pace], axis=2), given], axis=2)
    flat = columns.reshape(-1, columns.shape[2])
    rows, place = np.unique(flat, axis=0, return_inverse=True)
    return rows, place.reshape(model.shape)


def has_laws(model: TransitionModel) -> bool:
    """Whether moves take times whose laws are parameters."""
    return isinstance(model, SemiMarkovModels) and model.n_laws > 0


def require_timed(model: object) -> SemiMarkovModels:
    """The transition model; SerdError where its moves take no time."""
    if not isinstance(model, SemiMarkovModels):
        raise SerdError(
            f"problem must have dwell times, got transitions of {type(model).__name__}; pass"
            " semi_markov_problem(problem)"
        )
    return model
