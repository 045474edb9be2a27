"""What a demo runs with, and the folder of one run."""

from pathlib import Path

from serd_app.navigation.settings import NavigationSettings, PolicyKind
from serd_files.settings import setting, setting_of
from serd_files.table import EpisodeResult, load_episodes
from serd_sim.episodes.episode import EpisodeSettings


class DemoSettings(EpisodeSettings):
    """Seeds: demonstrations use `seed`, the learned policy drives in a world of another one."""

    seed: int = setting_of(EpisodeSettings, "seed", default=3)
    demonstrations: int = setting(8, "number of demonstrations by the scripted expert", ge=1)
    episodes: int = setting_of(
        EpisodeSettings, "episodes", default=10, description="episodes the learned policy drives"
    )
    policy: PolicyKind = setting_of(NavigationSettings, "policy")

    @property
    def navigation_seed(self) -> int:
        """Seed of the world the learned policy is measured in."""
        return self.seed + 1000


class DemoFolder:
    """Paths of one run."""

    def __init__(self, root: Path) -> None:
        self.root = root.resolve()
        self.settings = self.root / "demo.yaml"
        self.bag = self.root / "bag"
        self.demonstrations = self.root / "demonstrations"
        self.model = self.root / "model.yaml"
        self.decisions = self.root / "decisions.csv"
        self.learning = self.root / "model.learning.csv"
        self.navigation = self.root / "navigation"
        self.layout = self.root / "foxglove.json"
        self.logs = self.root / "logs"

    @staticmethod
    def episodes(phase: Path) -> tuple[EpisodeResult, ...]:
        """Rows of a phase's episodes.csv, none before it exists."""
        table = phase / "episodes.csv"
        return load_episodes(table) if table.is_file() else ()
