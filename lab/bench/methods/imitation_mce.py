"""imitation: tabular MCE IRL (feature matching) under known transitions.

imitation 1.0.1 discounts visits but plans without a discount in training, which leads to other
rewards; here its planning gets the discount, so that it solves the problem that it states.
"""

from functools import partial

import numpy as np
import torch
from imitation.algorithms import mce_irl
from imitation.data.types import Trajectory
from imitation.rewards.reward_nets import RewardNet
from seals.base_envs import TabularModelPOMDP

TITLE = "imitation, MCE IRL"
REQUIREMENTS = (
    "imitation==1.0.1", "gymnasium==0.29.1", "stable-baselines3==2.2.1", "torch==2.15.0",
    "numpy==2.4.6",
)  # fmt: skip
SEEDS, MAX_STEPS, RATE = 20, 300, 0.2
PLAN = mce_irl.mce_partition_fh


class LinearReward(RewardNet):
    """Weights times the features of the state, without a constant."""

    def __init__(self, env):
        super().__init__(env.observation_space, env.action_space)
        self.weights = torch.nn.Parameter(torch.zeros(env.observation_matrix.shape[1]).double())

    def forward(self, state, *_):
        return state @ self.weights


def learn(given):
    """Weights after MAX_STEPS steps of Adam, or at the library's tolerance."""
    if "transitions" not in given or not given["available"].all():
        raise NotImplementedError("one goal, the same actions in all states, moves without times")
    features = given["features"]
    if np.ptp(features, axis=1).any():
        raise NotImplementedError("rewards of states")
    discount, paths, starts = float(given["discount"]), [], np.zeros(len(features))
    mce_irl.mce_partition_fh = partial(PLAN, discount=discount)
    for episode in np.unique(given["episode"]):
        rows = np.flatnonzero(given["episode"] == episode)
        starts[given["state"][rows[0]]] += 1.0 / len(np.unique(given["episode"]))
        states = np.append(given["state"][rows], given["next_state"][rows[-1]])
        paths.append(Trajectory(states, given["action"][rows], None, terminal=True))
    env = TabularModelPOMDP(
        transition_matrix=given["transitions"], observation_matrix=features[:, 0].astype(float),
        reward_matrix=np.zeros(len(features)), horizon=max(map(len, paths)),
        initial_state_dist=starts,
    )  # fmt: skip
    learner = mce_irl.MCEIRL(
        paths, env, LinearReward(env), np.random.default_rng(0), discount=discount,
        optimizer_kwargs={"lr": RATE}, log_interval=None,
    )  # fmt: skip
    learner.train(max_iter=MAX_STEPS)
    return {"weights": learner.reward_net.weights.detach().numpy()}
