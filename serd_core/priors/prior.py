"""What every prior offers: log P(theta) up to a constant, and its gradient."""

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from operator import is_

import numpy as np

from serd_core.arrays import FloatArray, gradient_differences, is_number, require_kind, shown
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
        """What makes value + constant a log density, over weights and coordinates of energies.

        SerdError where the prior is improper, or where its constant has no formula.
        """
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
        """Sum of values and of gradients."""
        value, gradient = 0.0, parameters.zeros()
        for part in (term.evaluate(model, parameters) for term in self.terms):
            value, gradient = value + part.value, gradient + part.gradient
        return LogPrior(value, gradient)

    def hessian(self, model: TransitionModel, parameters: Parameters) -> FloatArray:
        """Sum of the terms' second derivatives."""
        table = np.zeros((len(parameters.vector),) * 2)
        for term in self.terms:
            table += term.hessian(model, parameters)
        return table

    @property
    def blocks(self) -> tuple[Block, ...]:
        """The blocks of all terms."""
        return tuple(block for term in self.terms for block in term.blocks)

    def log_constant(self, model: TransitionModel, parameters: Parameters) -> float:
        """Sum of the terms' constants."""
        return float(sum(term.log_constant(model, parameters) for term in self.terms))

    def anchored(self, initial_local_probabilities: FloatArray) -> "Prior":
        """Anchor every term."""
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
