"""Rows of the table of docs/compare.md."""

from lab.benchmarks.recordings.compliance import _row


def test_a_log_likelihood_that_is_ruled_out_is_minus_infinity():
    found = {"n_surprising": 1, "n_decisions": 4, "n_episodes": 2, "log_likelihood": None}
    found |= {"simulated": -0.5, "mean_rank": 0.25, "n_unusual": 1}
    assert _row("a", found) == "| a | 2 | 4 | -inf | -0.500 | 0.25 | 50 % | 25.0 % |\n"
