"""What every prior offers: log P(theta) up to a constant, and its gradient; and the normal one.

log P(theta) = -sum (theta - mean)^2 / (2 sd^2) - Z      (section 4.6.2)
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from operator import is_

import numpy as np

from serd_core.arrays import FloatArray, gradient_differences
from serd_core.checks import is_number, number_array, require_kind, require_positive, shown
from serd_core.dynamics.transition_model import TransitionModel
from serd_core.errors import SerdError
from serd_core.posterior.parameters import Block, Parameters


@dataclass(frozen=True, eq=False)
class LogPrior:
    """log P(theta) + Z and its gradient by every block."""

    value: float
    gradient: Parameters

    def __post_init__(self) -> None:
        require_kind("gradient of a LogPrior", self.gradient, (Parameters,), "parameters.zeros()")
        if np.isnan(self.value) or np.isnan(self.gradient.vector).any():
            raise SerdError(
                f"a LogPrior must hold numbers, got the value {self.value} and the gradient"
                f" {self.gradient.vector}; correct the prior that returns it"
            )


class Prior(ABC):
    """A log prior; priors add up with `+`."""

    @abstractmethod
    def evaluate(self, model: TransitionModel, parameters: Parameters) -> LogPrior:
        """Value and gradient at `parameters` of the transition model."""

    def values(self, model: TransitionModel, at: Sequence[Parameters]) -> FloatArray:
        """(n,) values at as many points; one after another unless overridden."""
        return np.array([self.evaluate(model, each).value for each in at])

    def hessian(self, model: TransitionModel, parameters: Parameters) -> FloatArray:
        """(n, n) second derivatives by all blocks in a row; by differences unless overridden."""
        return gradient_differences(
            lambda at: self.evaluate(model, parameters.with_vector(at)).gradient.vector,
            parameters.vector,
        )

    @property
    def blocks(self) -> tuple[Block, ...]:
        """The blocks whose density this is, given those that it only refers to."""
        raise SerdError(self._improper)

    def log_constant(self, model: TransitionModel, parameters: Parameters) -> float:
        """What makes value + constant a log density, over weights and coordinates of energies."""
        del model, parameters
        raise SerdError(self._improper)

    @property
    def _improper(self) -> str:
        return (
            "evidence and posteriors need priors that are densities, normalised to 1, got"
            f" {type(self).__name__}; use GaussianPrior for rewards, DirichletPrior for dynamics"
        )

    def anchored(self, initial_local_probabilities: FloatArray) -> "Prior":
        """The same prior, referring to the initial dynamics where no reference was given."""
        del initial_local_probabilities
        return self

    def __add__(self, other: "Prior") -> "Prior":
        return SumOfPriors((self, other))


@dataclass(frozen=True)
class SumOfPriors(Prior):
    """Product of independent priors."""

    terms: tuple[Prior, ...]

    def __post_init__(self) -> None:
        for term in self.terms:
            require_kind("a term of a sum of priors", term, (Prior,), "UniformPrior()")

    def evaluate(self, model: TransitionModel, parameters: Parameters) -> LogPrior:
        value, gradient = 0.0, parameters.zeros()
        for part in (term.evaluate(model, parameters) for term in self.terms):
            value, gradient = value + part.value, gradient + part.gradient
        return LogPrior(value, gradient)

    def values(self, model: TransitionModel, at: Sequence[Parameters]) -> FloatArray:
        return sum((term.values(model, at) for term in self.terms), np.zeros(len(at)))

    def hessian(self, model: TransitionModel, parameters: Parameters) -> FloatArray:
        table = np.zeros((len(parameters.vector),) * 2)
        for term in self.terms:
            table += term.hessian(model, parameters)
        return table

    @property
    def blocks(self) -> tuple[Block, ...]:
        return tuple(block for term in self.terms for block in term.blocks)

    def log_constant(self, model: TransitionModel, parameters: Parameters) -> float:
        return float(sum(term.log_constant(model, parameters) for term in self.terms))

    def anchored(self, initial_local_probabilities: FloatArray) -> "Prior":
        terms = tuple(term.anchored(initial_local_probabilities) for term in self.terms)
        # By identity: priors of users may hold arrays, whose comparison is no single truth value.
        return self if all(map(is_, terms, self.terms)) else SumOfPriors(terms)


def terms_of(prior: Prior) -> tuple[Prior, ...]:
    """The factors of a prior that are no products themselves."""
    if isinstance(prior, SumOfPriors):
        return tuple(factor for term in prior.terms for factor in terms_of(term))
    return (prior,)


@dataclass(frozen=True)
class UniformPrior(SumOfPriors):
    """No prior: log P(theta) = 0, so that a fit finds the most likely parameters."""

    terms: tuple[Prior, ...] = field(default=(), init=False, repr=False)


def require_dynamics_block(name: str, block: Block) -> None:
    """SerdError unless a prior is one of belief or truth."""
    if block not in (Block.BELIEF, Block.TRUTH):
        raise SerdError(f"block of {name} must be BELIEF or TRUTH, got {block.name}")


def require_weight(name: str, weight: float) -> None:
    """SerdError unless the weight is finite and not negative."""
    if not (is_number(weight) and 0.0 <= weight < np.inf):
        raise SerdError(
            f"{name} must be finite and not negative, got {shown(weight)}; use 0 for none"
        )


#: Largest mean, standard deviation and inverse of one, of which fourth powers are finite.
_LARGEST = 1e50


@dataclass(frozen=True)
class GaussianPrior(Prior):
    """A prior on any block: independent normal distributions with one mean (section 4.6.2).

    standard_deviation: one for the block, or a tuple of one per number, in the block's units.

        prior = sc.GaussianPrior(2.0, sc.Block.REWARD)
    """

    standard_deviation: float | tuple[float, ...]
    block: Block
    mean: float = 0.0

    def __post_init__(self) -> None:
        name = "standard_deviation of GaussianPrior"
        for value in number_array(name, self.standard_deviation).ravel():
            require_positive(name, value)
            if not 1.0 / _LARGEST <= value <= _LARGEST:
                raise SerdError(
                    f"{name} must be from {1.0 / _LARGEST:g} to {_LARGEST:g}, got {shown(value)};"
                    " use for example 1"
                )
        require_kind("block of GaussianPrior", self.block, (Block,), "Block.REWARD")
        if not (is_number(self.mean) and abs(self.mean) <= _LARGEST):
            raise SerdError(
                f"mean of GaussianPrior must be from -{_LARGEST:g} to {_LARGEST:g}, got"
                f" {shown(self.mean)}; use for example 0"
            )

    def evaluate(self, model: TransitionModel, parameters: Parameters) -> LogPrior:
        del model
        theta = parameters.block(self.block)
        deviation = self._deviations(theta)
        away = (theta - self.mean) / deviation
        gradient = parameters.zeros().with_block(self.block, -away / deviation)
        return LogPrior(-0.5 * float(np.sum(away**2)), gradient)

    def values(self, model: TransitionModel, at: Sequence[Parameters]) -> FloatArray:
        del model
        theta = np.stack([each.block(self.block) for each in at])
        away = (theta - self.mean) / self._deviations(theta[0])
        return np.asarray(-0.5 * np.sum(away**2, axis=1))

    def hessian(self, model: TransitionModel, parameters: Parameters) -> FloatArray:
        """-1 / sd^2 on the block's diagonal."""
        del model
        deviation = self._deviations(parameters.block(self.block))
        return parameters.placed(self.block, np.diag(-1.0 / deviation**2))

    @property
    def blocks(self) -> tuple[Block, ...]:
        """The block; SerdError where that is no vector of real numbers without gauge."""
        if self.block is not Block.REWARD:
            raise SerdError(self._improper)
        return (self.block,)

    def log_constant(self, model: TransitionModel, parameters: Parameters) -> float:
        """-sum log(sd sqrt(2 pi)) over the reward weights."""
        del model
        deviation = self._deviations(parameters.block(*self.blocks))
        return -float(np.sum(np.log(deviation) + 0.5 * np.log(2.0 * np.pi)))

    def _deviations(self, theta: FloatArray) -> FloatArray:
        """(n,) of each number; SerdError where there are as many as it has not."""
        given = np.asarray(self.standard_deviation, dtype=np.float64)
        if given.ndim and given.shape != theta.shape:
            raise SerdError(
                f"standard_deviation of GaussianPrior must have one number or {len(theta)}, one"
                f" per parameter of the block {self.block.value}, got {len(given)}"
            )
        return np.broadcast_to(given, theta.shape)
