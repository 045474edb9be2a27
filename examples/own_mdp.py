"""An MDP of your own: a machine that wears out, whose owner knows how fast and you do not.

States are how worn it is, 0 to 9. To run it pays, less the more it is worn, and it wears by 0, 1 or
2. To repair it costs something and makes it new. From what the owner did, SERD learns what running
and repairing are worth, and how the machine wears. Pictures: wear.png.
"""

import numpy as np

import serd_core as sc

RUN, REPAIR = 0, 1
worn = np.arange(10)
successors = np.empty((10, 2, 3), dtype=int)  # [state, action, outcome]
successors[:, RUN] = np.minimum(worn[:, None] + [0, 1, 2], 9)
successors[:, REPAIR] = 0
features = np.zeros((10, 2, 2))  # [state, action, feature]
features[:, RUN, 0] = 1.0 - worn / 9.0
features[:, REPAIR, 1] = 1.0
#: Running has the outcome model 0 in each state. What repairing leads to is certain.
model_of = np.tile([RUN, REPAIR], (10, 1))
models = sc.OutcomeModels(successors, model_of, np.ones((10, 2), dtype=bool), 2)
machine = sc.TabularProblem(sc.Mdp(models, 0.95), features, ("output", "repair"))

truth, rng = np.array([[0.3, 0.5, 0.2], [1 / 3] * 3]), np.random.default_rng(1)
owner = sc.soft_policy(machine, [4.0, -6.0], truth)
seen = sc.sample_decisions(machine.mdp, owner, truth, n_episodes=40, n_steps=50, rng=rng)

fit = sc.fit_mdce_serd(machine, seen)
errors = sc.standard_errors(machine, sc.fit_information(machine, seen, fit))
print(fit.summary(errors))
draws = sc.laplace_draws(sc.laplace(machine, seen, fit), rng, 400)
wear = np.quantile(draws.outcome_probabilities[:, RUN], [0.05, 0.5, 0.95], axis=0)
print("wears by 0, 1, 2:", wear[1].round(2))
bars = {"learned, 90 %": wear, "truth": truth[RUN]}
axes = sc.plots.outcomes(bars, ["0", "1", "2"])
axes.legend()
axes.figure.savefig("wear.png")
