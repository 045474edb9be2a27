"""What a session of driving by hand runs with."""

import os
import socket
import sys
from pathlib import Path
from typing import Any

from serd_cli.errors import UsageError
from serd_ros.graph.configs import TeleopPageConfig
from serd_ros.graph.graph import Stack, find_stack
from sim.episodes.settings import EpisodeSettings, WorldSettings
from storage.settings import setting, setting_of
from storage.yaml_config import StrictModel
from teleop.page.access import PageAccess, read_token

KEYBOARD, PAGE = "teleop_keyboard", "teleop_page"


class TeleopSettings(StrictModel):
    """Settings of a session."""

    scenario: str = setting_of(EpisodeSettings, "scenario")
    seed: int = setting_of(EpisodeSettings, "seed")
    start_area: str = setting_of(WorldSettings, "start_area")
    people: int | None = setting_of(WorldSettings, "people")
    page: bool = setting(True, "drive through a web page")
    keyboard: bool = setting(False, "drive with this terminal's keys too")
    velocity: bool = setting(False, "drive by velocities, not by directions")
    driver: str = setting("", "name of the driver in the episode marks; the node's own when empty")
    address: str = setting_of(TeleopPageConfig, "address")
    port: int = setting_of(TeleopPageConfig, "port")
    token_file: str = setting_of(TeleopPageConfig, "token_file")

    def stack(self) -> Stack:
        """The stack `teleop` with the ways to drive that are wanted."""
        stack = find_stack("teleop")
        others = tuple(node for node in stack.nodes if node not in (KEYBOARD, PAGE))
        wanted = ((PAGE,) if self.page else ()) + ((KEYBOARD,) if self.keyboard else ())
        return stack.model_copy(update={"nodes": (*others, *wanted)})

    def parameters(self, bag: Path) -> dict[str, Any]:
        """Parameters of its nodes."""
        given: dict[str, Any] = {
            "scenario": self.scenario,
            "seed": self.seed,
            "start_area": self.start_area,
            "mode": "velocity" if self.velocity else "directions",
            "demo_recorder.output": str(bag),
        }
        if self.driver:
            given["driver"] = self.driver
        if self.people is not None:
            given["people"] = self.people
        if self.page:
            given |= {"address": self.address, "port": self.port}
            given["token_file"] = str(Path(self.token_file).resolve()) if self.token_file else ""
        if self.keyboard:
            given["terminal"] = os.ttyname(sys.stdin.fileno())
        return given


def require_a_way_to_drive(settings: TeleopSettings) -> None:
    """UsageError where neither the keyboard nor the page can work."""
    if settings.keyboard and not sys.stdin.isatty():
        raise UsageError("the keyboard needs a terminal as standard input; start it in a window")
    if settings.page:
        PageAccess(settings.address, read_token(settings.token_file))
    if settings.page and settings.port:
        _require_free(settings.address, settings.port)


def _require_free(address: str, port: int) -> None:
    family = socket.AF_INET6 if ":" in address else socket.AF_INET
    with socket.socket(family) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((address, port))
        except OSError as error:
            raise UsageError(
                f"cannot serve the page on {address} port {port}: {error.strerror or error}"
                "; choose another with --port, 0 takes a free one"
            ) from None
