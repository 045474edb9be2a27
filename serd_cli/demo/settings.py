"""What a demo runs with; kept beside its results, so that it can be continued or run again."""

from serd_app.navigation.settings import NavigationSettings, PolicyKind
from sim.episodes.settings import EpisodeSettings
from storage.settings import setting, setting_of


class DemoSettings(EpisodeSettings):
    """Seeds: demonstrations use `seed`, the learned policy drives in a world of another one."""

    seed: int = setting_of(EpisodeSettings, "seed", default=3)
    demonstrations: int = setting(20, "number of demonstrations by the scripted expert", ge=1)
    episodes: int = setting_of(
        EpisodeSettings, "episodes", default=30, description="episodes the learned policy drives"
    )
    density: bool = setting(False, "outcomes depend on the density of the recorded people")
    policy: PolicyKind = setting_of(NavigationSettings, "policy")

    @property
    def navigation_seed(self) -> int:
        """Seed of the world the learned policy is measured in."""
        return self.seed + 1000
