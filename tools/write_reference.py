"""Write nodes.yaml, docs/nodes.md and the tables of keys in docs/scenarios.md and docs/sources.md.

Run `make reference` after changing a setting or the graph.
"""

import re
import textwrap
from pathlib import Path
from typing import Any

import yaml
from pydantic import BaseModel
from pydantic_core import PydanticUndefined

from serd_app.drives.mapping import BagMapping, DriveMapping, TableMapping
from serd_files.settings import Setting, settings_of
from serd_ros.graph.graph import config_of, load_graph
from serd_sim.planning.settings import PlannerSettings
from serd_sim.scenario import settings as parts
from serd_sim.scenario.scenario import Scenario

ROOT = Path(__file__).resolve().parents[1]
#: The settings of each node with their defaults.
Parameters = dict[str, list[tuple[Setting, Any]]]
#: Models whose tables stand in a page of docs, each after a comment `<!-- keys: NAME -->`.
PARTS: dict[str, tuple[type[BaseModel], ...]] = {
    "scenarios.md": (
        *(Scenario, parts.Obstacle, parts.PedestrianSettings, parts.Loop, parts.RobotSettings),
        *(parts.LidarSettings, parts.OdometrySettings, PlannerSettings),
    ),
    "sources.md": (BagMapping, DriveMapping, TableMapping),
}
NODES_YAML = ROOT / "ros_ws/src/serd_ros/config/nodes.yaml"
NODES_PAGE = ROOT / "docs/nodes.md"


def files() -> dict[Path, str]:
    """The text of each generated file."""
    parameters = {}
    for node, config in ((node, config_of(node)) for node in load_graph().nodes):
        defaults = config.defaults({})
        parameters[node] = [(each, defaults[each.name]) for each in settings_of(config)]
    return {
        NODES_YAML: nodes_yaml(parameters),
        NODES_PAGE: nodes_page(parameters),
        **{ROOT / "docs" / name: page_of_keys(name) for name in PARTS},
    }


def nodes_yaml(parameters: Parameters) -> str:
    """Parameters with defaults and descriptions as comments, below the present head."""
    lines = [line for line in NODES_YAML.read_text().splitlines() if line.startswith("#")]
    for node, settings in parameters.items():
        lines += [f"{node}:", "  ros__parameters:"]
        for setting, default in settings:
            about = "; ".join(filter(None, (setting.description, setting.range)))
            lines += [f"    # {line}" for line in textwrap.wrap(about, 94)]
            lines.append(f"    {setting.name}: {plain(default)}")
    return "\n".join(lines) + "\n"


def nodes_page(parameters: Parameters) -> str:
    """Below the present head for each node its endpoints and a table of its parameters."""
    page = NODES_PAGE.read_text(encoding="utf-8").partition("\n## ")[0]
    for node, settings in parameters.items():
        page += f"\n## {node}\n\n"
        for kind, names in load_graph().nodes[node].model_dump(exclude={"node"}).items():
            if names:
                shown = ", ".join(f"`{name}`" for name in names)
                page += f"- {kind.replace('_', ' ')}: {shown}\n"
        if live := [f"`{setting.name}`" for setting, _ in settings if setting.live]:
            page += f"- parameters that may change while it runs: {', '.join(live)}\n"
        page += "\n" + settings_table("parameter", settings)
    return page


def page_of_keys(name: str) -> str:
    """A page of docs with its tables of keys written anew."""
    page = (ROOT / "docs" / name).read_text(encoding="utf-8")
    for part in PARTS[name]:
        # Keys that hold a model have a table of their own, and those of a base are in its table.
        bases = (base for base in part.__bases__ if base in PARTS[name])
        inherited = {key for base in bases for key in base.model_fields}
        keys = [
            (each, each.default)
            for each in settings_of(part)
            if "$ref" not in each.schema and each.name not in inherited
        ]
        marker = f"<!-- keys: {part.__name__} -->\n\n"
        table = marker + settings_table("key", keys)
        page = re.sub(rf"{marker}(\|.*\n)*", lambda _, text=table: text, page)
    return page


def settings_table(head: str, settings: list[tuple[Setting, Any]]) -> str:
    """A Markdown table of settings with their defaults."""
    table = f"| {head} | default | range | meaning |\n| --- | --- | --- | --- |\n"
    for each, default in settings:
        shown = "required" if default is PydanticUndefined else f"`{plain(default)}`"
        shown = "" if default is None else shown  # where it follows from another setting
        about = each.description.replace("|", "\\|")
        table += f"| `{each.name}` | {shown} | {each.range} | {about} |\n"
    return table


def plain(value: Any) -> str:
    """A default as YAML in one line."""
    value = list(value) if isinstance(value, tuple) else value
    text = yaml.safe_dump(value, default_flow_style=True, width=1000).strip()
    return text.removesuffix("...").strip()


if __name__ == "__main__":
    for path, text in files().items():
        path.write_text(text, encoding="utf-8")
        print(f"wrote {path.relative_to(ROOT)}")
