"""The border: a wrong argument of a public function is a sentence with its name, rule and fix."""

import inspect

import numpy as np
import pytest

import serd_core as sc
from serd_core import checks


def words(text):
    return text.split()


#: What no argument of these names takes: another kind, no number, no finite one, another shape.
KINDS = ["x", 0.5, object()]
NO_ARRAYS = ["x", [["a"]], [np.nan, 0.0], np.ones((7, 7, 7, 7)), object()]
NO_NUMBERS = ["1", [1.0, 2.0], np.nan, object()]
NOT_POSITIVE = [*NO_NUMBERS, 0.0, -1.0]
NO_COUNTS = ["1", 1.5, -1, None]
WRONG = {
    **dict.fromkeys(
        words("""
        problem decisions samples mdp transitions prior ascent rng fit information found restricted
        full
"""),
        KINDS,
    ),
    **dict.fromkeys(
        words("""
        initial_weights reward_weights dynamics policy sampling_policy
        thresholds outcome_probabilities start_distribution features terminal_features episode
        time_s state action next_state successors model_of available probability clusters matrix
        meat period
"""),
        NO_ARRAYS,
    ),
    **dict.fromkeys(
        words("pseudo_count temperature initial_temperature inverse_temperature largest_weight"),
        NOT_POSITIVE,
    ),
    **dict.fromkeys(
        words("slack discount weight gradient_tolerance"),
        NO_NUMBERS,
    ),
    **dict.fromkeys(
        words("n_episodes n_steps n_periods n_models n"),
        NO_COUNTS,
    ),
    "terminal": ["x", 3, [[1], [0, 1]], ["a"], [True], [99]],
    "feature_names": ["x", [1, 2], ["goal", "goal"]],
    "belief": [*KINDS, sc.FreeBelief],
    "short": NO_NUMBERS,
}
#: Words in which sentences name tables that several arguments give.
NAMED = dict.fromkeys(("dynamics", "outcome_probabilities"), "outcome probabilities")
NAMED["state"] = "probability"


@pytest.fixture(scope="module")
def valid(gridworld):
    """A valid value of each argument, by name; some by function."""
    problem, decisions = gridworld.problem, gridworld.decisions
    fit = sc.fit_mdce_serd(problem, decisions)
    models, table = problem.mdp.transitions, gridworld.probabilities
    uniform = np.full(problem.mdp.available.shape, 1.0 / problem.mdp.n_actions)
    return {
        **dict.fromkeys(words("decisions samples"), decisions),
        **dict.fromkeys(words("outcome_probabilities dynamics"), table),
        **dict.fromkeys(words("policy sampling_policy"), uniform),
        **dict.fromkeys(words("fit restricted full"), fit),
        **dict.fromkeys(words("temperature weight standard_deviation"), 1.0),
        **dict.fromkeys(words("n_episodes n_steps n_periods"), 2),
        "problem": problem,
        "mdp": problem.mdp,
        "transitions": models,
        "reward_weights": gridworld.weights,
        "initial_weights": np.zeros(2),
        "estimate": lambda some: some.action.mean(),
        "start_distribution": np.full(25, 1 / 25),
        "rng": np.random.default_rng(0),
        "thresholds": np.zeros(2),
        "features": problem.features,
        "feature_names": problem.feature_names,
        **{name: getattr(models, name) for name in words("successors model_of available n_models")},
        "discount": 0.9,
        "block": sc.Block.REWARD,
        "information": sc.fit_information(problem, decisions, fit),
        "found": sc.laplace(problem, decisions, fit),
        "n_pairs": (25, 5),
        "probability": np.ones(len(decisions)),
        "n_states": 25,
        **decisions.columns(),
    }


CALLS = [
    getattr(sc, name)
    for name in words("""
    fit_mdce_serd fit_pm_serd fit_maxent_irl fit_mdce_irl_by_likelihood fit_mdce_irl_by_entropy
    fit_policy_matching fit_relative_entropy_irl
    clone_behaviour estimate_dynamics soft_policy optimal_policy
    boltzmann_policy sample_decisions finite_horizon policy_log_likelihood move_log_likelihood
    bootstrap decisions_in_periods fit_information standard_errors clustered_outer_product
    identifiability likelihood_ratio_test laplace outcome_information
    expected_information_gain fitted_policy validation_log_likelihood
    fixed_transitions from_transitions
    KldPrior GaussianPrior Decisions OutcomeModels TabularProblem Mdp
    DirichletPrior CoupledBelief Lbfgs TrustRegion NewtonAscent
    KinkedAscent
""")
]


def arguments(call):
    parameters = inspect.signature(call).parameters
    return [n for n, p in parameters.items() if p.default is p.empty], list(parameters)


@pytest.mark.parametrize(
    ("call", "name"),
    [(call, name) for call in CALLS for name in arguments(call)[1] if name in WRONG],
    ids=lambda part: part if isinstance(part, str) else part.__name__,
)
def test_a_wrong_argument_is_one_line_with_name_rule_value_and_fix(valid, call, name):
    required, _ = arguments(call)
    given = {each: valid[each] for each in required if each != name}
    if "initial_weights" in inspect.signature(call).parameters:
        given["initial_weights"] = valid["initial_weights"]
    if call is sc.from_transitions:
        given |= {"transitions": np.full((2, 1, 2), 0.5), "features": np.ones((2, 2))}
    if call is sc.DirichletPrior:
        given["pseudo_count"] = 1.0
    if name == "rng":
        given.pop("initial_weights", None)
        given["prior" if call is sc.fit_mdce_serd else "rng"] = sc.UniformPrior()
    for wrong in WRONG[name]:
        with pytest.raises(sc.SerdError) as caught:
            call(**given | {name: wrong})
        sentence = str(caught.value)
        assert "\n" not in sentence
        assert name in sentence or NAMED.get(name, name) in sentence
        assert " must " in sentence
        assert "; " in sentence


@pytest.mark.parametrize("solve", [sc.soft_policy, sc.optimal_policy])
def test_weights_whose_values_overflow_are_rejected(gridworld, solve):
    problem, table = gridworld.problem, gridworld.probabilities
    for size in (1e308, 1e300):
        for weights in ([0.0, size], [size, -size]):
            with pytest.raises(
                sc.SerdError, match=r"rewards\[\d+, \d\] must be finite and at most"
            ):
                solve(problem, weights, table)
    with pytest.raises(sc.SerdError, match="problem must have an mdp and feature_names, got a Mdp"):
        solve(problem.mdp, [0.0, 1.0], table)
    assert np.all(np.isfinite(solve(problem, [0.0, 1e298], table).probabilities))


def test_arguments_in_another_order_are_named_and_policies_are_taken_as_solved(gridworld):
    problem, decisions = gridworld.problem, gridworld.decisions
    for call in (
        lambda: sc.fit_mdce_serd(decisions, problem),
        lambda: sc.clone_behaviour(decisions, problem),
        lambda: sc.fit_information(problem, decisions, decisions),
        lambda: sc.soft_policy(problem, decisions),
        lambda: sc.sample_decisions(problem, [], n_episodes=1, n_steps=1, rng=None),
    ):
        with pytest.raises(sc.SerdError, match=r"\(are the arguments in the right order\?\)"):
            call()
    table, rngs = gridworld.probabilities, [np.random.default_rng(0) for _ in range(2)]
    solved = sc.soft_policy(problem, gridworld.weights, table)
    drawn = [
        sc.sample_decisions(problem.mdp, policy, table, n_episodes=5, n_steps=9, rng=rng)
        for policy, rng in zip((solved, solved.probabilities), rngs, strict=True)
    ]
    np.testing.assert_array_equal(drawn[0].next_state, drawn[1].next_state)


LISTED = [0, 0, 1, 1], [0, 1, 0, 1], [0, 1, 1, 0]


def test_what_would_not_fit_into_memory_is_refused_with_the_bytes_it_needs(gridworld, monkeypatch):
    problem = gridworld.problem
    monkeypatch.setattr(checks, "memory_limit", lambda: 30_000)
    with pytest.raises(
        sc.SerdError,
        match=r"the transitions of 25 states and 5 actions must fit into memory, but needs"
        r" 5.62e\+04 bytes of 3e\+04; use fewer states",
    ):
        sc.Mdp(problem.mdp.transitions, 0.9)
    with pytest.raises(sc.SerdError, match="second derivatives by 47 parameters over 25 states"):
        sc.fit_mdce_serd(problem, gridworld.decisions)
    monkeypatch.setattr(checks, "memory_limit", lambda: 799)  # entry by entry is more
    with pytest.raises(sc.SerdError, match=r"must fit into memory, but needs 800 bytes of 799"):
        sc.Mdp(sc.fixed_transitions((2, 2), *LISTED, np.ones(4)), 0.9)


@pytest.mark.parametrize("shape", [(10**12 + 1, 1), (1, 10**12 + 1)], ids=["states", "actions"])
def test_numbers_of_states_with_gaps_are_refused_before_memory_is_used(shape):
    with pytest.raises(sc.SerdError, match=r"fit into memory.* number states and actions from"):
        sc.fixed_transitions(shape, [0], [0], [0], [1.0])
