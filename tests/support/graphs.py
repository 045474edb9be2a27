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


def small_world(n_states):
    """A ring in which one state of twenty leads anywhere."""
    successors, rng = ring(n_states), np.random.default_rng(0)
    far = rng.random(n_states) < 0.05
    successors[far, 4] = rng.integers(n_states, size=int(far.sum()))
    return successors


def ring(n_states):
    """One or two steps either way around."""
    return (np.arange(n_states)[:, None] + np.array([0, 1, -1, 2, -2])) % n_states


def chain(n_states):
    """A line whose ends hold; the first state is absorbing."""
    successors = np.arange(n_states)[:, None] + np.array([0, 1, -1, 2, -2])
    successors[0] = 0
    return np.clip(successors, 0, n_states - 1)


def tree(n_states):
    """To the parent or to one of two children."""
    own = np.arange(n_states)
    children = [np.where(2 * own + side < n_states, 2 * own + side, own) for side in (1, 2)]
    return np.column_stack([own, np.maximum(own - 1, 0) // 2, *children, own])


def star(n_states):
    """Rings of as many states as there are rings, each around a centre; the centres around one."""
    own, size = np.arange(n_states), round(n_states**0.5)
    centre = own // size * size
    next_on_ring = np.minimum(np.where(own % size == size - 1, centre, own + 1), n_states - 1)
    return np.column_stack([own, centre, next_on_ring, np.where(own == centre, 0, own), centre])


def hub(n_states):
    """A chain each state of which may lead to the first one."""
    own = np.arange(n_states)
    steps = np.clip(own[:, None] + np.array([0, 1, -1]), 0, n_states - 1)
    return np.column_stack([steps, np.zeros(n_states, dtype=np.int64)])


GRAPHS = {
    "grid": grid,
    "cube": cube,
    "random graph": random_graph,
    "small world": small_world,
    "ring": ring,
    "chain": chain,
    "tree": tree,
    "star": star,
    "hub": hub,
}


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
