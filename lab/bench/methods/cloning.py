"""Behavioural cloning: smoothed shares of the actions in each state, which know no other task."""

import serd_core as sc
from lab.bench.given import decisions_of, problem_of

TITLE, REQUIREMENTS = "cloning", ()


def learn(given):
    """The shares, also for the other task where that has the same states."""
    problem, transfer = problem_of(given), problem_of(given, "transfer_")
    policy = sc.clone_behaviour(problem, decisions_of(given))
    return {"policy": policy, "transfer_policy": None if transfer is None else policy}
