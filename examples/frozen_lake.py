"""FrozenLake of Gymnasium, from its decisions to intervals and a picture: lake.png."""

import gymnasium
import numpy as np

import serd_core as sc

lake = sc.from_gymnasium(gymnasium.make("FrozenLake-v1"), discount=0.95)
expert, rng = sc.soft_policy(lake, [20.0]), np.random.default_rng(1)
decisions = sc.sample_decisions(lake.mdp, expert, n_episodes=200, n_steps=100, rng=rng)
fit = sc.fit_mdce_serd(lake, decisions)
errors = sc.standard_errors(lake, sc.fit_information(lake, decisions, fit))
print(fit.summary(errors))
sc.plots.policy(expert, (4, 4), sc.plots.values(expert.value, (4, 4))).figure.savefig("lake.png")
