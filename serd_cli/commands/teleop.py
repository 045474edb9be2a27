"""World, planner, mux, recorder and page are started; drive, save or discard episodes.

Ctrl-C ends. Each session has a new session-N folder.
"""

from pathlib import Path
from typing import Annotated, Any

from serd_cli.options import AsJson, free_folder, opt, resolved_scenario, validated, with_settings
from serd_files.settings import setting, setting_of
from serd_files.yaml_config import StrictModel
from serd_ros.settings import PageConfig
from serd_sim.episodes.episode import EpisodeSettings, WorldSettings


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


Output = Annotated[Path, opt("folder that gets a session-N folder")]


@with_settings(TeleopSettings)
def teleop(output: Output = Path("teleop_output"), as_json: AsJson = False, **options: Any) -> None:
    """Parse the options, run the stack and print what was recorded."""
    from serd_cli.processes.teleop_session import require_page, require_start, run_session

    options["scenario"] = resolved_scenario(options["scenario"])
    settings = validated(TeleopSettings, **options)
    require_start(settings)
    require_page(settings)
    run_session(settings, free_folder(output, "session").resolve(), as_json=as_json)
