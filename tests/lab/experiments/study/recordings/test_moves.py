import numpy as np

from lab.experiments.study.recordings.moves import counted_moves, decisions_of_moves
from serd_core.dynamics.estimation import estimate_dynamics


def test_counted_decisions_estimate_the_same_dynamics(problem, shipped_training):
    counted = decisions_of_moves(counted_moves(shipped_training))
    assert len(counted) == len(shipped_training)
    np.testing.assert_allclose(
        estimate_dynamics(problem, counted), estimate_dynamics(problem, shipped_training), atol=1e-9
    )


def test_every_move_is_counted_once(shipped_training):
    moves = counted_moves(shipped_training)
    assert len({move[:3] for move in moves}) == len(moves)
    state, action, following, count = max(moves, key=lambda move: move[3])
    seen = shipped_training
    same = (seen.state == state) & (seen.action == action) & (seen.next_state == following)
    assert count == same.sum() > 1


def test_no_moves_are_no_decisions():
    assert len(decisions_of_moves([])) == 0
