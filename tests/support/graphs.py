"""Graphs of many kinds as MDPs: each action leads towards one of the neighbours of its state."""

import numpy as np

from serd_core.dynamics.outcome_models import OutcomeModels
from serd_core.mdp.mdp import Mdp


def grid(n_states):
    """Square of cells with four neighbours."""
    return _lattice(round(n_states ** (1 / 2)), 2)


def cube(n_states):
    """Cube of cells with six neighbours."""
    return _lattice(round(n_states ** (1 / 3)), 3)


def random_graph(n_states):
    """Four successors anywhere."""
    rng = np.random.default_rng(0)
    return np.column_stack([np.arange(n_states), rng.integers(n_states, size=(n_states, 4))])


def ring(n_states):
    """One or two steps either way around."""
    return (np.arange(n_states)[:, None] + np.array([0, 1, -1, 2, -2])) % n_states


def tree(n_states):
    """To the parent or to one of two children."""
    own = np.arange(n_states)
    children = [np.where(2 * own + side < n_states, 2 * own + side, own) for side in (1, 2)]
    return np.column_stack([own, np.maximum(own - 1, 0) // 2, *children, own])


GRAPHS = {"grid": grid, "cube": cube, "random graph": random_graph, "ring": ring, "tree": tree}


def mdp_of(successors, discount):
    """An MDP for (S, K) successors, with an action towards each."""
    n_states, n_actions = successors.shape
    models = OutcomeModels(
        np.repeat(successors[:, None, :], n_actions, axis=1),
        np.tile(np.arange(n_actions), (n_states, 1)),
        np.ones((n_states, n_actions), dtype=bool),
        n_actions,
    )
    return Mdp(models, discount)


def _lattice(side, n_dimensions):
    shape = (side,) * n_dimensions
    place = np.indices(shape).reshape(n_dimensions, -1)
    columns = [np.arange(side**n_dimensions)]
    for axis in range(n_dimensions):
        for step in (1, -1):
            moved = place.copy()
            moved[axis] = np.clip(moved[axis] + step, 0, side - 1)
            columns.append(np.ravel_multi_index(tuple(moved), shape))
    return np.column_stack(columns)
