"""Learning and solving against public libraries that compute the same, in one run.

Two problems on the 400 cells of section 4.6.2 with known dynamics and two reward weights, and one
that only solves. In each, the results are compared before the times are:

likelihood: argmax of sum log pi(a|s) over infinite-horizon soft policies (3.33), discount 0.99.
features: weights whose soft policy has the discounted feature averages of the demonstrations
(3.34), discount 0.9, episodes of 200 decisions, so that a horizon of 200 is as good as an infinite
one (0.9^200 < 1e-9); they start anywhere, as from the southern edge the goal is too far to matter.
optimal control: values of the hard Bellman equation (2.24), sparse, 400 and 40,000 states.

Times are processor times, so that other work on the machine does not count. All linear algebra runs
in one thread; XLA may use more, whose times add up.
"""

import json
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import scipy.sparse

from lab.benchmarks.learning.gridworld_problems import (
    DYNAMICS,
    WEIGHTS,
    demonstrations,
    landscape_problem,
)
from lab.benchmarks.peers.peer_environment import run_peer
from lab.benchmarks.report import Row, best_of, save
from lab.experiments.gridworld.problem import Gridworld
from serd_core.arrays import FloatArray
from serd_core.ascent.trust_region import TrustRegion
from serd_core.demonstrations.decisions import Decisions, start_distribution
from serd_core.dynamics.transition_model import transitions_of
from serd_core.learners.mdce_irl import fit_mdce_irl_by_entropy, fit_mdce_irl_by_likelihood
from serd_core.policies.solved_policy import optimal_policy

#: Largest difference of a weight (true ones are 6) and, relative, of a value that counts as equal.
SAME_WEIGHT, SAME_VALUE = 5e-3, 1e-6
#: Needs the fewest steps among 0.05, 0.2 and 0.5; the library's default is 0.01.
LEARNING_RATE = 0.5


def run() -> None:
    """Compare everything; peers are installed on the first run."""
    with tempfile.TemporaryDirectory() as folder:
        rows = [*_likelihood(Path(folder)), *_features(Path(folder))]
        for side in (20, 200):
            rows += _optimal_control(Path(folder), side)
    save("learning_peers", "Against public libraries on the same problems", rows)


def _likelihood(folder: Path) -> list[Row]:
    world = landscape_problem(20, 0.99)
    decisions = demonstrations(world, 25, 40)
    start = np.zeros(2)

    def fit() -> FloatArray:
        return fit_mdce_irl_by_likelihood(
            world.problem, decisions, initial_weights=start, dynamics=DYNAMICS,
            ascent=TrustRegion(),
        ).reward_weights  # fmt: skip

    file = _write_learning_problem(folder / "likelihood.npz", world, decisions, 40)
    peers = {"econirl NFXP": ("learning", "econirl_fit.py", "nfxp")}
    return compare_weights("likelihood", fit, peers, file)


def _features(folder: Path) -> list[Row]:
    world = landscape_problem(20, 0.9)
    decisions = demonstrations(world, 60, 200, starts=np.full(400, 1.0 / 400))
    start = np.zeros(2)

    def fit() -> FloatArray:
        return fit_mdce_irl_by_entropy(
            world.problem, decisions, initial_weights=start, dynamics=DYNAMICS
        ).reward_weights

    file = _write_learning_problem(folder / "features.npz", world, decisions, 200)
    peers = {
        "econirl MCE-IRL": ("learning", "econirl_fit.py", "mce_irl"),
        "imitation MCE-IRL": ("learning", "imitation_fit.py", str(LEARNING_RATE)),
    }
    return compare_weights("features", fit, peers, file)


def compare_weights(
    problem: str, fit: Callable[[], FloatArray], peers: dict[str, tuple[str, str, str]], file: Path
) -> list[Row]:
    """Rows of a fit and of peers: by name, environment, script and its first argument."""
    own_s, own = best_of(fit, calls=3)
    rows: list[Row] = [_row(problem, "serd_core", own_s, own_s, 0.0, same=True, converged=True)]
    for name, (environment, script, word) in peers.items():
        result = file.with_suffix(".json")
        run_peer(environment, script, word, file, result)
        found = json.loads(result.read_text())
        apart = float(np.max(np.abs(own - np.array(found["weights"]))))
        rows.append(_row(problem, name, found["seconds"], own_s, apart,
                         same=apart <= SAME_WEIGHT, converged=found["converged"]))  # fmt: skip
    return rows


def _optimal_control(folder: Path, side: int) -> list[Row]:
    world = landscape_problem(side, 0.99)
    own_s, own = best_of(lambda: optimal_policy(world.problem, WEIGHTS, DYNAMICS).value, calls=3)
    scale = float(np.max(np.abs(own)))
    file, result = folder / "control.npz", folder / "solved.npz"
    _write_control_problem(file, world, scale)
    run_peer("learning", "quantecon_solve.py", file, result)
    name = f"optimal control, {len(own)} states"
    rows: list[Row] = [_row(name, "serd_core", own_s, own_s, 0.0, same=True, converged=True)]
    solved = np.load(result)
    for method in ("policy_iteration", "modified_policy_iteration", "value_iteration"):
        apart = float(np.max(np.abs(own - solved[f"{method}_value"]))) / scale
        seconds = float(solved[f"{method}_seconds"])
        by = f"QuantEcon {method.replace('_', ' ')}"
        same = apart <= SAME_VALUE
        rows.append(_row(name, by, seconds, own_s, apart, same=same, converged=same))
    return rows


def _row(
    problem: str,
    by: str,
    seconds: float,
    own_s: float,
    apart: float,
    *,
    same: bool,
    converged: bool,
) -> Row:
    return {
        "problem": problem,
        "by": by,
        "ms": 1e3 * seconds,
        "times serd_core": seconds / own_s,
        "difference of results": apart,
        "same": same,
        "converged": converged,
    }


def _write_learning_problem(
    file: Path, world: Gridworld, decisions: Decisions, horizon: int
) -> Path:
    mdp = world.problem.mdp
    dense = transitions_of(mdp.transitions, DYNAMICS).matrix.toarray()
    np.savez(
        file,
        transitions=dense.reshape(mdp.n_states, mdp.n_actions, mdp.n_states),
        features=world.problem.features,
        starts=start_distribution(decisions, mdp.n_states),
        discount=mdp.discount,
        horizon=horizon,
        **{name: getattr(decisions, name) for name in ("episode", "state", "action", "next_state")},
    )
    return file


def _write_control_problem(file: Path, world: Gridworld, scale: float) -> None:
    mdp = world.problem.mdp
    matrix = scipy.sparse.csr_matrix(transitions_of(mdp.transitions, DYNAMICS).matrix)
    matrix.sum_duplicates()
    state, action = np.divmod(np.arange(mdp.n_states * mdp.n_actions), mdp.n_actions)
    np.savez(
        file,
        rewards=(world.problem.features @ WEIGHTS).ravel(),
        data=matrix.data,
        indices=matrix.indices,
        indptr=matrix.indptr,
        shape=matrix.shape,
        discount=mdp.discount,
        state=state,
        action=action,
        epsilon=SAME_VALUE * scale,
    )
