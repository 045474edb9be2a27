"""Write nodes.yaml, docs/nodes.md, docs/scenario_keys.yaml and docs/mapping_keys.yaml.

Run `make reference` after changing a setting or the graph.
"""

import textwrap
from pathlib import Path
from typing import Any, get_args

import yaml
from pydantic import BaseModel
from pydantic_core import PydanticUndefined

from serd_app.drives.mapping import BagMapping, TableMapping
from serd_files.settings import Setting, settings_of
from serd_ros.graph.graph import config_of, load_graph
from serd_sim.scenario.scenario import Scenario

ROOT = Path(__file__).resolve().parents[1]
#: The settings of each node with their defaults.
Parameters = dict[str, list[tuple[Setting, Any]]]
NODES_YAML = ROOT / "ros_ws/src/serd_bringup/config/nodes.yaml"
NODES_PAGE = ROOT / "docs/nodes.md"
SCENARIO_KEYS = ROOT / "docs/scenario_keys.yaml"
MAPPING_KEYS = ROOT / "docs/mapping_keys.yaml"


def files() -> dict[Path, str]:
    """The text of each generated file."""
    parameters = {}
    for node, config in ((node, config_of(node)) for node in load_graph().nodes):
        defaults = config.defaults({})
        parameters[node] = [(each, defaults[each.name]) for each in settings_of(config)]
    return {
        NODES_YAML: nodes_yaml(parameters),
        NODES_PAGE: nodes_page(parameters),
        SCENARIO_KEYS: keys_file(SCENARIO_KEYS, Scenario),
        MAPPING_KEYS: keys_file(MAPPING_KEYS, BagMapping, TableMapping),
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
    """Below the present head the endpoints of each node, and what may change while it runs."""
    page = NODES_PAGE.read_text(encoding="utf-8").partition("\n## ")[0]
    for node, settings in parameters.items():
        page += f"\n## {node}\n\n"
        for kind, names in load_graph().nodes[node].model_dump(exclude={"node"}).items():
            if names:
                shown = ", ".join(f"`{name}`" for name in names)
                page += f"- {kind.replace('_', ' ')}: {shown}\n"
        names = ", ".join(f"`{setting.name}`" for setting, _ in settings if setting.live)
        page += f"- may change while it runs: {names}\n" if names else ""
    return page


def keys_file(path: Path, *models: type[BaseModel]) -> str:
    """Below the present head a YAML document for each model: its keys, defaults and meanings."""
    documents = ("\n".join(key_lines(model, "")) for model in models)
    return "\n".join(head_of(path)) + "\n\n" + "\n---\n".join(documents) + "\n"


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


def plain(value: Any) -> str:
    """A default as YAML in one line."""
    value = list(value) if isinstance(value, tuple) else value
    text = yaml.safe_dump(value, default_flow_style=True, width=1000).strip()
    return text.removesuffix("...").strip()


if __name__ == "__main__":
    for path, text in files().items():
        path.write_text(text, encoding="utf-8")
        print(f"wrote {path.relative_to(ROOT)}")
