"""What `serd navigate` drives with; kept beside its tables, so that it can be continued."""

from pathlib import Path
from typing import Any, Literal

from pydantic import Field

from serd_cli.errors import UsageError
from serd_ros.configs import StrategyConfig
from serd_ros.defaults import default_parameters
from serd_ros.params import validated
from storage.atomic import atomic_write_text
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
    """See `serd navigate --help` and the parameters of the strategy in nodes.yaml."""

    model: str
    scenario: str
    goal: str = ""
    start_area: str = "train"
    episodes: int = Field(default=20, ge=1)
    seed: int = Field(default=1000, ge=0)
    timeout_s: float = Field(default=420.0, gt=0)
    policy: Literal["optimal", "soft"] = "optimal"
    planner: str = "dwa"
    transfer: bool = False
    lookahead_cells: int = Field(default=1, ge=1)
    patience_periods: int = Field(default=60, ge=0)
    minimum_arrival_probability: float = Field(default=0.0, ge=0, le=1)

    def of_strategy(self) -> dict[str, Any]:
        """The strategy node's parameters among them."""
        return {name: getattr(self, name) for name in _OF_STRATEGY}

    def config(self, output: Path | None) -> StrategyConfig:
        """The strategy's parameters, its defaults included."""
        given = {"output": str(output) if output else ""}
        values = {**default_parameters()["strategy"], **self.of_strategy(), **given}
        return validated("strategy", values, StrategyConfig)


def claim_folder(folder: Path, settings: NavigateSettings) -> None:
    """Take a new folder, or one that was begun with the same settings; UsageError otherwise."""
    file = folder / _FILE
    if not file.is_file():
        if folder.exists() and any(folder.iterdir()):
            raise UsageError(
                f"{folder} must be new, empty or an earlier run's; give another folder"
            )
        atomic_write_text(file, model_yaml(settings))
        return
    earlier = load_yaml_model(file, NavigateSettings)
    different = [
        name
        for name in NavigateSettings.model_fields
        if name != "episodes" and getattr(earlier, name) != getattr(settings, name)
    ]
    if different:
        name = different[0]
        raise UsageError(
            f"{folder} was begun with {name} = {getattr(earlier, name)!r}, but "
            f"{getattr(settings, name)!r} is given; give another folder or the same settings"
        )
