"""What a demo runs with, and the folder of one run, which keeps that beside its results."""

from itertools import count
from pathlib import Path

from serd_app.navigation.settings import NavigationSettings, PolicyKind
from serd_cli.errors import UsageError
from serd_cli.options import free_folder
from serd_files.episode_table import EpisodeResult, load_episodes
from serd_files.settings import setting, setting_of
from serd_files.table import Column, append_row, read_table
from serd_files.yaml_config import load_yaml_model, save_yaml_model
from serd_sim.episodes.episode import EpisodeSettings

_TIMES = Column("phase", str), Column("wall_s", float)


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
    """Paths of one run; a phase is done when its product is there whole."""

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
        self._timings = self.root / "timings.csv"
        self.logs = self.root / "logs"

    def demonstrated(self, settings: DemoSettings) -> bool:
        """Whether all demonstrations are recorded and their bag is closed."""
        n_driven = len(self.episodes(self.demonstrations))
        return n_driven >= settings.demonstrations and (self.bag / "metadata.yaml").is_file()

    def learned(self) -> bool:
        """Whether the model is there."""
        return self.model.is_file() and self.learning.is_file()

    def navigated(self, settings: DemoSettings) -> bool:
        """Whether the learned policy has driven all its episodes."""
        return len(self.episodes(self.navigation)) >= settings.episodes

    def note_wall_time(self, phase: str, wall_s: float) -> None:
        """Append how long a phase took."""
        append_row(self._timings, _TIMES, (phase, wall_s))

    def wall_times_s(self) -> dict[str, float]:
        """How long the phases took by name; the last time, where one was run again."""
        if not self._timings.is_file():
            return {}
        return {row["phase"]: row["wall_s"] for row in read_table(self._timings, _TIMES)}

    @staticmethod
    def episodes(phase: Path) -> tuple[EpisodeResult, ...]:
        """Rows of a phase's episodes.csv, none before it exists."""
        table = phase / "episodes.csv"
        return load_episodes(table) if table.is_file() else ()

    def set_partial_bag_aside(self) -> None:
        """Keep an unfinished recording under another name; nothing recorded is deleted."""
        if self.bag.exists():
            names = (self.root / f"bag.partial-{number}" for number in count(1))
            self.bag.rename(next(name for name in names if not name.exists()))


def new_folder(output: Path, settings: DemoSettings) -> DemoFolder:
    """The next free `run-N` below `output`, with the settings in it."""
    folder = DemoFolder(free_folder(output, "run"))
    save_yaml_model(folder.settings, settings)
    return folder


def open_folder(root: Path) -> tuple[DemoFolder, DemoSettings]:
    """An earlier run's folder and settings, to continue it."""
    folder = DemoFolder(root)
    if not folder.settings.is_file():
        raise UsageError(f"{root} is no demo run (it has no demo.yaml); give a run-N folder")
    return folder, load_yaml_model(folder.settings, DemoSettings)
