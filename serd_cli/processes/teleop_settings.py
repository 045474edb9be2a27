"""Settings of a session of `serd teleop`; apart from what it starts, for the help is quick."""

from pathlib import Path
from typing import Any

from serd_files.settings import setting, setting_of
from serd_files.yaml_config import StrictModel
from serd_ros.settings import PageConfig
from serd_sim.episodes.settings import EpisodeSettings, WorldSettings


class TeleopSettings(StrictModel):
    """Settings of a session."""

    scenario: str = setting_of(EpisodeSettings, "scenario")
    seed: int = setting_of(EpisodeSettings, "seed")
    start_area: str = setting_of(WorldSettings, "start_area")
    people: int | None = setting_of(WorldSettings, "people")
    velocity: bool = setting(False, "drive by velocities, not by directions")
    driver: str = setting("", "name of the driver in the episode marks; the node's own when empty")
    address: str = setting_of(PageConfig, "address")
    port: int = setting_of(PageConfig, "port")
    token_file: str = setting_of(PageConfig, "token_file")

    def parameters(self, bag: Path) -> dict[str, Any]:
        """Parameters of the nodes of the stack `teleop`."""
        given: dict[str, Any] = {
            "scenario": self.scenario,
            "seed": self.seed,
            "start_area": self.start_area,
            "mode": "velocity" if self.velocity else "directions",
            "demo_recorder.output": str(bag),
            "address": self.address,
            "port": self.port,
            "token_file": str(Path(self.token_file).resolve()) if self.token_file else "",
        }
        if self.driver:
            given["driver"] = self.driver
        if self.people is not None:
            given["people"] = self.people
        return given
