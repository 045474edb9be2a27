"""imitation: tabular MCE IRL on a problem from a file.

    python imitation_fit.py LEARNING_RATE problem.npz result.json

Run in the environment of learning.txt. imitation 1.0.1 discounts visits but plans without a
discount in training, which leads to other rewards; here its planning gets the discount, so that it
solves the problem that it states. Work per step is the same. Timed is `train`, in processor time.
"""

import json
import sys
import time
from functools import partial
from pathlib import Path

import numpy as np
import torch
from imitation.algorithms import mce_irl
from imitation.data.types import Trajectory
from imitation.rewards.reward_nets import RewardNet
from seals.base_envs import TabularModelPOMDP

MAX_STEPS = 5_000


class LinearReward(RewardNet):
    """Weights times the features of the state, without a constant."""

    def __init__(self, env: TabularModelPOMDP) -> None:
        super().__init__(env.observation_space, env.action_space)
        n_features = env.observation_matrix.shape[1]
        self.weights = torch.nn.Parameter(torch.zeros(n_features, dtype=torch.float64))

    def forward(self, state, *_):
        return state @ self.weights


def main(learning_rate: float, problem_file: Path, result_file: Path) -> None:
    """Fit, write weights, seconds and whether the gradient got below the library's tolerance."""
    given = np.load(problem_file)
    discount = float(given["discount"])
    mce_irl.mce_partition_fh = partial(mce_irl.mce_partition_fh, discount=discount)
    env = TabularModelPOMDP(
        transition_matrix=given["transitions"],
        observation_matrix=given["features"][:, 0].astype(np.float64),
        reward_matrix=np.zeros(len(given["features"])),
        horizon=int(given["horizon"]),
        initial_state_dist=given["starts"],
    )
    reward = LinearReward(env)
    learner = mce_irl.MCEIRL(
        trajectories_of(given),
        env,
        reward,
        np.random.default_rng(0),
        optimizer_kwargs={"lr": learning_rate},
        discount=discount,
        log_interval=None,
    )
    began_s = time.process_time()
    learner.train(max_iter=MAX_STEPS)
    seconds = time.process_time() - began_s
    steps = learner.optimizer.state[reward.weights]["step"]
    result = {
        "weights": reward.weights.detach().numpy().tolist(),
        "seconds": seconds,
        "steps": int(steps),
        "converged": bool(torch.linalg.norm(reward.weights.grad) <= learner.grad_l2_eps),
    }
    result_file.write_text(json.dumps(result))


def trajectories_of(given: dict) -> list[Trajectory]:
    """Demonstrations with states for observations, the last state included."""
    found = []
    for episode in np.unique(given["episode"]):
        rows = np.flatnonzero(given["episode"] == episode)
        states = np.append(given["state"][rows], given["next_state"][rows[-1]])
        found.append(Trajectory(states, given["action"][rows], None, terminal=True))
    return found


if __name__ == "__main__":
    main(float(sys.argv[1]), Path(sys.argv[2]), Path(sys.argv[3]))
