"""Settings of a series of episodes: the scenario, the seed, how many, how long, and the world."""

from serd_files.settings import setting
from serd_files.yaml_config import StrictModel
from serd_sim.planning.catalogue import planner_names
from serd_sim.scenario.scenario import Scenario


class EpisodeSettings(StrictModel):
    """One series of episodes in a scenario."""

    scenario: str = setting(
        "hallway", "built-in scenario or path of a scenario YAML file", min_length=1
    )
    seed: int = setting(0, "seed of people, starts and random choices", ge=0)
    episodes: int = setting(20, "number of episodes to drive", ge=1)
    timeout_s: float = setting(
        Scenario.model_fields["episode_timeout_s"].default,
        "simulated time per episode",
        unit="s",
        ge=2,
        le=86400,
    )


class WorldSettings(StrictModel):
    """What surrounds the driver of an episode."""

    start_area: str = setting("train", "start area of the scenario in which episodes begin")
    people: int | None = setting(None, "number of people; as the scenario has it by default", ge=0)
    planner: str = setting("dwa", "local planner: " + " or ".join(planner_names()))
