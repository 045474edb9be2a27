"""Write nodes.yaml, docs/nodes.md, docs/scenario_keys.yaml and the tables of docs/sources.md.

Run `make reference` after changing a setting or the graph.
"""

import re
import textwrap
from pathlib import Path
from typing import Any, get_args

import yaml
from pydantic import BaseModel
from pydantic_core import PydanticUndefined

from serd_app.drives.mapping import BagMapping, DriveMapping, TableMapping
from serd_files.settings import Setting, settings_of
from serd_ros.graph.graph import config_of, load_graph
from serd_sim.scenario.scenario import Scenario

ROOT = Path(__file__).resolve().parents[1]
#: The settings of each node with their defaults.
Parameters = dict[str, list[tuple[Setting, Any]]]
#: Models whose tables stand in a page of docs, each after a comment `<!-- keys: NAME -->`.
PARTS: dict[str, tuple[type[BaseModel], ...]] = {
    "sources.md": (BagMapping, DriveMapping, TableMapping),
}
NODES_YAML = ROOT / "ros_ws/src/serd_ros/config/nodes.yaml"
NODES_PAGE = ROOT / "docs/nodes.md"
SCENARIO_KEYS = ROOT / "docs/scenario_keys.yaml"


def files() -> dict[Path, str]:
    """The text of each generated file."""
    parameters = {}
    for node, config in ((node, config_of(node)) for node in load_graph().nodes):
        defaults = config.defaults({})
        parameters[node] = [(each, defaults[each.name]) for each in settings_of(config)]
    return {
        NODES_YAML: nodes_yaml(parameters),
        NODES_PAGE: nodes_page(parameters),
        SCENARIO_KEYS: scenario_keys(),
        **{ROOT / "docs" / name: page_of_keys(name) for name in PARTS},
    }


def nodes_yaml(parameters: Parameters) -> str:
    """Parameters with defaults and descriptions as comments, below the present head."""
    lines = head_of(NODES_YAML)
    for node, settings in parameters.items():
        lines += [f"{node}:", "  ros__parameters:"]
        for setting, default in settings:
            lines += [*comment(setting, "    "), f"    {setting.name}: {plain(default)}"]
    return "\n".join(lines) + "\n"


def nodes_page(parameters: Parameters) -> str:
    """Below the present head for each node its endpoints and its parameters with their defaults."""
    page = NODES_PAGE.read_text(encoding="utf-8").partition("\n## ")[0]
    for node, settings in parameters.items():
        page += f"\n## {node}\n\n"
        for kind, names in load_graph().nodes[node].model_dump(exclude={"node"}).items():
            if names:
                shown = ", ".join(f"`{name}`" for name in names)
                page += f"- {kind.replace('_', ' ')}: {shown}\n"
        for kind, is_live in (("parameters", False), ("may change while it runs", True)):
            names = [
                f"`{each.name}:={plain(value)}`"
                for each, value in settings
                if bool(each.live) == is_live
            ]
            page += f"- {kind}: {', '.join(names)}\n" if names else ""
    return page


def scenario_keys() -> str:
    """Keys of a scenario file with defaults and descriptions, below the present head."""
    return "\n".join([*head_of(SCENARIO_KEYS), "", *key_lines(Scenario, "")]) + "\n"


def key_lines(model: type[BaseModel], indent: str) -> list[str]:
    """The keys of a model, and below a key that holds models the keys of these."""
    lines = []
    for each in settings_of(model):
        annotation = model.model_fields[each.name].annotation
        inner = [kind for kind in (annotation, *get_args(annotation)) if is_model(kind)]
        lines += comment(each, indent) if "description" in each.schema else []
        if inner:
            items = [f"{indent}  -"] if inner[0] is not annotation else []
            below = indent + "  " * (1 + len(items))
            lines += [f"{indent}{each.name}:", *items, *key_lines(inner[0], below)]
        elif each.default is PydanticUndefined:
            lines.append(f"{indent}{each.name}:  # required")
        else:
            default = "" if each.default is None else f" {plain(each.default)}"
            lines.append(f"{indent}{each.name}:{default}")
    return lines


def is_model(kind: Any) -> bool:
    """Whether a type is a model of settings."""
    return isinstance(kind, type) and issubclass(kind, BaseModel)


def head_of(path: Path) -> list[str]:
    """The comments at the left margin of a generated YAML file before its first key."""
    lines = path.read_text(encoding="utf-8").splitlines()
    return lines[: next(at for at, line in enumerate(lines) if not line.startswith("#"))]


def comment(setting: Setting, indent: str) -> list[str]:
    """Description, unit and range of a setting as lines of YAML comments."""
    about = "; ".join(filter(None, (setting.description, setting.range)))
    return [f"{indent}# {line}" for line in textwrap.wrap(about, 98 - len(indent))]


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
