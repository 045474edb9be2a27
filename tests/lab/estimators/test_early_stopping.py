import numpy as np
import pytest

from lab.estimators.early_stopping import (
    EarlyStopping,
    fit_serd_with_early_stopping,
    validation_score,
)
from lab.estimators.gradient_ascent import GradientAscent
from serd_core.ascent.ascent import FunctionObjective
from serd_core.dynamics.estimation import estimate_dynamics
from serd_core.learners.serd import fit_mdce_serd
from serd_core.policies.solved_policy import MdcePolicy
from serd_core.posterior.beliefs import TiedBelief
from serd_core.priors.prior import UniformPrior
from serd_core.selection.evaluation import split_episodes, validation_log_likelihood


def slope(vector):
    return -float(vector @ vector) / 2, -vector


def test_the_step_with_the_best_score_is_returned():
    ascent = EarlyStopping(
        GradientAscent(step_size=lambda _: 0.1), lambda v: -abs(float(v[0]) - 0.5), patience=3
    )
    found = ascent.maximise(FunctionObjective(slope), np.array([1.0]), lambda _: False)
    assert found.vector[0] == pytest.approx(0.9**7)
    assert found.n_steps == 7
    assert len(found.objective_trace) == 7
    assert not found.converged
    assert found.message.startswith("stopped early: best validation score")


def test_no_other_step_of_the_fit_explains_the_validation_set_better(make_gridworld):
    case = make_gridworld(side=5, n_episodes=12, n_steps=8)
    training, validation = split_episodes(case.decisions, 0.5, np.random.default_rng(0))
    start = {
        "initial_weights": np.array([-4.0, 9.0]),
        "dynamics": estimate_dynamics(case.problem, training),
    }
    scores = []
    fit = fit_serd_with_early_stopping(
        case.problem, training, validation, MdcePolicy(), patience=15, **start
    )
    score = validation_score(case.problem, validation, MdcePolicy(), TiedBelief(), fit.parameters)
    fit_mdce_serd(
        case.problem,
        training,
        prior=UniformPrior(),
        on_step=lambda step: scores.append(score(step.vector)),
        **start,
    )
    reached = validation_log_likelihood(case.problem, validation, fit)
    assert reached == pytest.approx(max(scores[: fit.n_steps + 15]), abs=1e-6)
    assert reached > scores[-1]
    assert not fit.converged
    assert fit.message.startswith("stopped early")
