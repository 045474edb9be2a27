"""A feature of the reward of your own: do drivers of the corridor keep to its western half?

An expert drives in simulation. Its decisions are learned from with the usual features and with
`west`, whose weight should be that of no preference, as this expert has none.
"""

import numpy as np

import serd_core as sc
from serd_app.demonstrations.decision_table import concatenate_renumbered
from serd_sim.drivers.catalogue import make_driver
from serd_sim.episodes.episode import run_episode
from serd_sim.planning.local_planner import make_planner
from serd_sim.scenario.grid import navigation_problem_of
from serd_sim.scenario.scenario import load_scenario
from serd_sim.world.world import HallwayWorld

scenario = load_scenario("corridor").with_pedestrian_count(6)
with HallwayWorld(scenario, seed=2) as world:
    planner, expert = make_planner(scenario), make_driver("expert", scenario, 2)
    drives = [run_episode(world, planner, expert, episode=number) for number in range(6)]
decisions = concatenate_renumbered([drive.decisions for drive in drives])

usual = navigation_problem_of(scenario, discount=0.95)
west = usual.grid.centers_m[:, 0] < usual.grid.centers_m[:, 0].mean()  # of each cell
of_pairs = np.repeat(west[:, None, None], usual.mdp.n_actions, axis=1)
features = np.concatenate([usual.features, of_pairs], axis=2)
own = sc.TabularProblem(usual.mdp, features, (*usual.feature_names, "west"))

fit = sc.fit_mdce_serd(own, decisions)
print(fit.summary(sc.standard_errors(own, sc.fit_information(own, decisions, fit))))
policy = sc.soft_policy(own, fit.reward_weights, fit.outcome_probabilities)
axes = sc.plots.occupancy(decisions, usual.grid)
sc.plots.policy(policy.greedy, usual.grid, axes).figure.savefig("west.png")
