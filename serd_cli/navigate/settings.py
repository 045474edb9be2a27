"""What `serd navigate` drives with; kept beside its tables, so that it can be continued."""

import hashlib
from pathlib import Path
from typing import Any, Literal

from pydantic import Field

from serd_cli.errors import UsageError
from serd_cli.output_place import require_folder
from serd_ros.parameters.configs import StrategyConfig
from serd_ros.parameters.defaults import default_parameters
from serd_ros.parameters.params import validated
from sim.scenario.scenario import Scenario, load_scenario, scenario_digest
from storage.atomic import atomic_write_text
from storage.text_file import read_text
from storage.yaml_config import StrictModel, load_yaml_model, model_yaml

_FILE = "navigate.yaml"
#: Parameters of the strategy node that are settings here under the same name.
_OF_STRATEGY = (
    "scenario",
    "seed",
    "episodes",
    "timeout_s",
    "model",
    "policy",
    "transfer",
    "goal",
    "lookahead_cells",
    "patience_periods",
    "minimum_arrival_probability",
)


class NavigateSettings(StrictModel):
    """See `serd navigate --help` and the parameters of the strategy in nodes.yaml.

    people: how many walk, None for as many as the scenario says.
    """

    model: str
    scenario: str
    goal: str = ""
    start_area: str = "train"
    people: int | None = Field(default=None, ge=1)
    episodes: int = Field(default=20, ge=1)
    seed: int = Field(default=1000, ge=0)
    timeout_s: float = Field(default=420.0, gt=0)
    policy: Literal["optimal", "soft"] = "optimal"
    planner: str = "dwa"
    transfer: bool = False
    lookahead_cells: int = Field(default=1, ge=1)
    patience_periods: int = Field(default=60, ge=0)
    minimum_arrival_probability: float = Field(default=0.0, ge=0, le=1)

    def place(self) -> Scenario:
        """The scenario with its people, and its own goal."""
        own = load_scenario(self.scenario)
        return own if self.people is None else own.with_pedestrian_count(self.people)

    def of_strategy(self) -> dict[str, Any]:
        """The strategy node's parameters among them."""
        return {name: getattr(self, name) for name in _OF_STRATEGY}

    def config(self, output: Path | None) -> StrategyConfig:
        """The strategy's parameters, its defaults included."""
        given = {"output": str(output) if output else ""}
        values = {**default_parameters()["strategy"], **self.of_strategy(), **given}
        return validated("strategy", values, StrategyConfig)


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
