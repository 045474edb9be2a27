"""What `serd navigate` drives with; kept beside its tables, so that it can be continued."""

import hashlib
from pathlib import Path
from typing import Any

from serd_app.navigation.settings import NavigationSettings
from serd_cli.errors import UsageError
from serd_cli.output_paths import require_folder
from sim.episodes.settings import WorldSettings
from sim.scenario.scenario import Scenario, load_scenario, scenario_digest
from storage.files import atomic_write_text, read_text
from storage.yaml_config import load_yaml_model, model_yaml

_FILE = "navigate.yaml"


class NavigateSettings(NavigationSettings, WorldSettings):
    """Settings of one drive of `serd navigate`."""

    def place(self) -> Scenario:
        """The scenario with its people, and its own goal."""
        own = load_scenario(self.scenario)
        return own if self.people is None else own.with_pedestrian_count(self.people)

    def of_strategy(self) -> dict[str, Any]:
        """Those that are parameters of the strategy node."""
        return self.model_dump(include=set(NavigationSettings.model_fields))


class BegunDrive(NavigateSettings):
    """What stands beside the tables: the settings, and digests of what the two files said.

    Empty digests are those of a folder that was begun before they were kept.
    """

    model_digest: str = ""
    scenario_digest: str = ""


def claim_folder(folder: Path, settings: NavigateSettings) -> None:
    """Take a new folder, or one that was begun with the same settings; UsageError otherwise."""
    file = folder / _FILE
    now = _begun_with(settings)
    require_folder(folder)
    if not file.is_file():
        if folder.exists() and any(folder.iterdir()):
            raise UsageError(
                f"{folder} must be new, empty or an earlier run's; give another folder"
            )
        atomic_write_text(file, model_yaml(now))
        return
    _require_same(folder, load_yaml_model(file, BegunDrive), now)


def _begun_with(settings: NavigateSettings) -> BegunDrive:
    return BegunDrive(
        **settings.model_dump(),
        model_digest=hashlib.sha256(read_text(settings.model).encode()).hexdigest()[:12],
        scenario_digest=scenario_digest(settings.place()),
    )


def _require_same(folder: Path, earlier: BegunDrive, now: BegunDrive) -> None:
    for name in NavigateSettings.model_fields:
        if name != "episodes" and getattr(earlier, name) != getattr(now, name):
            raise UsageError(
                f"{folder} was begun with {name} = {getattr(earlier, name)!r}, but "
                f"{getattr(now, name)!r} is given; give another folder or the same settings"
            )
    for name, kept, found in (
        (now.model, earlier.model_digest, now.model_digest),
        (now.scenario, earlier.scenario_digest, now.scenario_digest),
    ):
        if kept != found:
            raise UsageError(
                f"{folder} must hold drives of {name} as it is now ({found}), but was begun with "
                f"{kept or 'an unknown version'} of it; give another folder"
            )
