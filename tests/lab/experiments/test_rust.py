import numpy as np

from lab.experiments import rust
from lab.experiments.rust import KEEP, REPLACE


def bus(odometer, first=0.0, second=0.0):
    header = np.zeros(rust.HEADER_LENGTH)
    header[[5, 8]] = [first, second]
    return np.concatenate([header, odometer])


def test_a_replacement_resets_the_mileage_and_falls_in_the_month_before():
    column = bus([4000.0, 9000.0, 12000.0, 16000.0, 21000.0], first=11000.0)
    state, decision = rust.states_and_decisions(column, 5000.0)
    np.testing.assert_array_equal(decision, [KEEP, REPLACE, KEEP, KEEP, KEEP])
    np.testing.assert_array_equal(state, [0, 1, 0, 0, 1])
    np.testing.assert_array_equal(rust.monthly_increments(state, decision), [1, 1, 0, 1])


def test_replacing_goes_on_from_the_first_bin():
    problem = rust.rust_problem(n_bins=6, n_increments=3, discount=0.9)
    successors = problem.mdp.transitions.successors
    np.testing.assert_array_equal(successors[4, KEEP], [4, 5, 5])
    np.testing.assert_array_equal(successors[4, REPLACE], successors[0, KEEP])
    np.testing.assert_allclose(problem.features[4, KEEP], [-0.004, 0.0])
    np.testing.assert_allclose(problem.features[4, REPLACE], [0.0, -1.0])


def test_each_bus_month_carries_the_increment_that_led_into_it():
    rows = np.array([[0, 1, KEEP], [0, 3, REPLACE], [1, 5, KEEP]])
    decisions = rust.as_decisions(rows, np.array([1, 2, 2]), n_bins=6)
    np.testing.assert_array_equal(decisions.next_state, [2, 2, 5])
    np.testing.assert_array_equal(decisions.episodes, [0, 1])
