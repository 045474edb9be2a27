"""Scripted experts of several characters, so that demonstrations differ as those of people do.

Each style has its own reaction time, patience, wavering and liking for the right-hand side. None of
these numbers is a feature or a weight that is later estimated.
"""

from serd_core.grid.grid import Action
from serd_sim.drivers.expert import ExpertSettings, ScriptedExpert
from serd_sim.drivers.expert_route import RouteCosts
from serd_sim.scenario.scenario import Scenario
from serd_sim.world.observation import Observation
from serd_sim.world.seeds import EXPERT, episode_rng

STYLES: dict[str, ExpertSettings] = {
    "steady": ExpertSettings(
        costs=RouteCosts(lane_dislike=0.2),
        waver_probability=0.03,
        wait_probability=0.15,
        reaction_delay_s=0.2,
    ),
    "hasty": ExpertSettings(
        costs=RouteCosts(against_flow=2.5, across_flow=0.2, turning=0.2),
        waver_probability=0.08,
        wait_probability=0.05,
        reaction_delay_s=0.15,
    ),
    "cautious": ExpertSettings(
        costs=RouteCosts(against_flow=6.0, across_flow=0.8),
        waver_probability=0.05,
        wait_probability=0.6,
        blocked_radius_m=0.7,
        look_ahead_s=0.8,
        longest_wait=3,
        reaction_delay_s=0.3,
    ),
    "wavering": ExpertSettings(
        costs=RouteCosts(lane_dislike=0.6),
        waver_probability=0.15,
        waver_cost=3.0,
        reaction_delay_s=0.4,
    ),
}


class VariedExpert:
    """Another style in each episode, drawn by the episode's number; style: the present one."""

    name = "varied_expert"

    def __init__(self, scenario: Scenario, seed: int) -> None:
        self._seed = seed
        self._experts = {
            style: ScriptedExpert(scenario, seed, settings) for style, settings in STYLES.items()
        }
        self.begin(0)

    def begin(self, episode: int) -> None:
        """Draw the style, then this episode's likes and dislikes."""
        drawn = episode_rng(self._seed, episode, EXPERT, 1).integers(len(self._experts))
        self.style = tuple(self._experts)[int(drawn)]
        self._experts[self.style].begin(episode)

    def decide(self, observation: Observation) -> Action:
        """As the expert of this episode decides."""
        return self._experts[self.style].decide(observation)
