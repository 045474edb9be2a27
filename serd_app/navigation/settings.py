"""Settings of a strategy and of its drives: model, goal, when it gives up, the world."""

from typing import Literal

from serd_files.settings import setting, setting_of
from serd_files.yaml_config import StrictModel
from serd_sim.episodes.episode import EpisodeSettings, WorldSettings
from serd_sim.scenario.scenario import Scenario, load_scenario

PolicyKind = Literal["optimal", "soft"]


class ApproachSettings(StrictModel):
    """When the robot is at a goal pose; wider than the 0.25 of Nav2, which then stops within."""

    xy_goal_tolerance: float = setting(
        0.3, "a goal pose is reached within this distance", live="any", unit="m", gt=0, le=10
    )
    yaw_goal_tolerance: float = setting(
        0.35, "and within this angle", live="any", unit="rad", gt=0, le=3.1416
    )


class NavigationSettings(EpisodeSettings):
    """How a learned model drives a series of episodes."""

    seed: int = setting_of(EpisodeSettings, "seed", default=1000)
    model: str = setting("model.yaml", "file of a learned model", min_length=1)
    policy: PolicyKind = setting(
        "optimal",
        "optimal: the optimum of the learned rewards; soft: the stochastic policy of the expert",
    )
    plan_quantile: float = setting(
        0.0,
        "avoid what is not known: plan by this quantile of what a decision leads to over the draws"
        " of the posterior (0.1); 0: by their mean",
        ge=0,
        lt=1,
    )
    transfer: bool = setting(False, "also accept a model that was learned on another grid")
    goal: str = setting(
        "", "x,y (m) of the cell to drive to; the goal area of the scenario when empty"
    )
    patience_decisions: int = setting(
        60, "give up after this long without progress; 0: never", live="any", unit="decisions", ge=0
    )
    minimum_arrival_probability: float = setting(
        0.0,
        "give up below this probability of arriving before the time-out",
        live="any",
        ge=0,
        le=1,
    )


class DriveSettings(NavigationSettings, WorldSettings):
    """Settings of a series of episodes in the simulated world."""

    def place(self) -> Scenario:
        """The scenario with its people, and its own goal."""
        own = load_scenario(self.scenario)
        return own if self.people is None else own.with_pedestrian_count(self.people)
