"""A scenario: a place whose parts fit together, as one YAML file."""

import hashlib
from pathlib import Path
from typing import Any

from pydantic import ValidationError, model_validator

from serd_bag.files import read_text
from serd_files.yaml_config import load_yaml_model, sentence_of
from serd_sim.errors import SimError
from serd_sim.planning.settings import PlannerSettings
from serd_sim.scenario.names import scenario_file
from serd_sim.scenario.place import Place
from serd_sim.scenario.rules import require_consistent

#: What the cells of a place depend on.
_OF_CELLS = {"walkable_area_m", "obstacles", "cell_size_m", "cell_clearance_m", "robot"}


class Scenario(Place):
    """Everything that defines a world except the seed."""

    @model_validator(mode="after")
    def _consistent(self) -> "Scenario":
        require_consistent(self)
        return self

    def model_copy(self, *, update: Any = None, deep: bool = False) -> "Scenario":
        """As of pydantic, but what is computed from the place is computed anew for another one."""
        copied = super().model_copy(update=update, deep=deep)
        if _OF_CELLS & (update or {}).keys():
            for name in ("cells", "wall_segments_m"):
                copied.__dict__.pop(name, None)
        return copied

    def with_pedestrian_count(self, count: int) -> "Scenario":
        """The same scenario with another number of people."""
        if count < 0:
            raise SimError(f"the number of people must be at least 0, got {count}; use 0 for none")
        return self.with_values("pedestrians", count=count)

    def with_values(self, part: str, **values: object) -> "Scenario":
        """The same scenario with other values in a part of it; SimError where they do not fit."""
        content = self.model_dump()
        try:
            return type(self).model_validate(content | {part: content[part] | values})
        except ValidationError as error:
            raise SimError(sentence_of(error, type(self))) from None

    def with_local_planner(self, parameters: PlannerSettings) -> "Scenario":
        """The same scenario with other parameters of the local planners."""
        try:
            parameters.require_within(self.robot, self.control_period_s)
        except ValueError as error:
            raise SimError(str(error)) from None
        return self.model_copy(update={"local_planner": parameters})


def scenario_content(scenario: Scenario) -> str:
    """All values of a scenario, and the URDF that it drives."""
    text = scenario.model_dump_json()
    if scenario.robot.drive == "physical":
        text += read_text(scenario.robot.urdf_path)
    return text


def scenario_digest(scenario: Scenario) -> str:
    """Digest of the content of a scenario."""
    return hashlib.sha256(scenario_content(scenario).encode()).hexdigest()[:12]


def load_scenario(name_or_path: str | Path) -> Scenario:
    """Scenario by the name of a built-in one or by the path of a YAML file."""
    return load_yaml_model(scenario_file(name_or_path), Scenario)
