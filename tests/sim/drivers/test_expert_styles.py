"""Scripted experts of several styles, and what a reaction delay does."""

from dataclasses import replace

import numpy as np

from serd_core.grid.grid import Action
from serd_sim.drivers.expert import STYLES, ExpertSettings, ScriptedExpert, VariedExpert
from serd_sim.scenario.grid import grid_of
from serd_sim.scenario.scenario import load_scenario
from support.observations import observation_at

HALLWAY = load_scenario("hallway")


def walking_towards(x_m):
    """The robot drives north at 1 m/s; a person walks west at 1 m/s towards x_m = 4.5."""
    return observation_at(
        4.5, 9.5, np.pi / 2, time_s=2.0, speed_mps=1.0, people=[(x_m, 10.5)], velocity=[(-1.0, 0.0)]
    )


def test_a_slow_expert_walks_on_where_a_quick_one_waits():
    patient = ExpertSettings(wait_probability=1.0, waver_probability=0.0, look_ahead_s=0.2)
    slow = replace(patient, reaction_delay_s=1.0)

    def waits(settings):
        expert = ScriptedExpert(HALLWAY, seed=1, settings=settings)
        expert.begin(0)
        state = grid_of(HALLWAY).state_at(4.5, 9.5)
        return expert.decide(walking_towards(4.9), state) == Action.WAIT

    assert waits(patient)
    assert not waits(slow)


def test_the_varied_expert_takes_every_style_in_turn_of_chance_and_repeats_itself():
    expert = VariedExpert(HALLWAY, seed=2)
    chosen = []
    for episode in range(40):
        expert.begin(episode)
        chosen.append(expert.style)
    assert set(chosen) == set(STYLES)
    expert.begin(7)
    assert expert.style == chosen[7]
