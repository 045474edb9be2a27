import numpy as np
import pytest

import serd_core as sc
from serd_core.demonstrations.decisions import COLUMNS
from serd_core.demonstrations.observations import observe
from support.refusals import refusals
from tests.support.semi_markov import demonstrations, ring, timed_ring

TABLE = {
    "episode": [0, 0, 0],
    "time_s": [0.0, 1.0, 2.5],
    "state": [9, 10, 10],
    "action": [0, 1, 0],
    "next_state": [10, 10, 11],
    "dwell_s": [1.0, 1.5, 0.9],
    "censored": [False, True, False],
}


def timed_decisions(**change):
    return sc.TimedDecisions(**{**TABLE, **change})


def test_censored_decisions_count_as_choices_and_not_as_moves():
    timed, _ = timed_ring()
    seen = observe(timed, timed_decisions())
    assert seen.n_decisions == 3
    assert seen.state_action[10, 1] == 1.0
    assert seen.group_count.sum() == 2.0
    assert seen.dwells.censored.tolist() == [False, True, False]
    # Where moves take no time, they are no moves either: nothing there stays in its place.
    assert observe(ring(), timed_decisions()).dwells is None


def test_hidden_actions_count_as_moves_and_inform_no_law():
    timed, truth = timed_ring()
    decisions = demonstrations(timed, truth, np.random.default_rng(5))
    hidden = decisions.with_hidden_actions(np.arange(len(decisions)) % 2 == 0)
    seen = observe(timed, hidden)
    assert seen.hidden.count.sum() == np.sum(hidden.hidden & ~hidden.censored)
    assert not hidden.hidden[seen.dwells.row].any()
    assert sc.fit_mdce_serd(timed, hidden, dynamics=truth).converged


def test_sampled_dwell_times_have_the_laws_they_are_drawn_from():
    timed, truth = timed_ring()
    rng = np.random.default_rng(6)
    found = demonstrations(timed, truth, rng, n_episodes=150, until_command_s=np.inf)
    assert not found.censored.any()
    moves = found.action == 0
    assert found.dwell_s[moves].mean() == pytest.approx(1.0, abs=0.05)
    assert found.dwell_s[moves].var() == pytest.approx(1.0 / 5.0, abs=0.03)
    often = demonstrations(timed, truth, rng, n_episodes=150, until_command_s=1.0)
    assert often.censored.mean() == pytest.approx(0.6, abs=0.12)
    assert np.all(often.next_state[often.censored] == often.state[often.censored])
    at_the_goal = np.eye(timed.mdp.n_states)[0]
    size = {"n_episodes": 2, "n_steps": 3, "rng": rng}
    policy = timed.mdp.available / timed.mdp.available.sum(axis=1, keepdims=True)
    assert len(sc.sample_timed_decisions(timed.mdp, policy, truth, at_the_goal, **size)) == 0


def test_dwell_times_survive_a_round_trip():
    again = sc.TimedDecisions(**timed_decisions().columns()).select(np.array([1, 2]))
    assert again.dwell_s.tolist() == [1.5, 0.9]
    assert again.censored.tolist() == [True, False]


PLAIN = sc.Decisions(*(TABLE[name] for name in COLUMNS)).select([0, 2])
test_dwell_times_are_required_and_above_0 = refusals(
    (lambda: timed_decisions(dwell_s=[1.0, 0.0, 1.0]), r"dwell_s\[1\] must be above 0"),
    (lambda: timed_decisions(next_state=[10, 11, 11]), r"next_state\[1\] must be the state where"),
    (lambda: timed_decisions(dwell_s=[1.0]), "dwell_s must have shape"),
    (lambda: observe(timed_ring()[0], PLAIN), "must have dwell times for moves that take"),
)
