"""Default parameters, read once from nodes.yaml beside this file."""

from functools import cache
from pathlib import Path
from typing import Any

from storage.yaml_text import read_yaml

NODES_YAML = Path(__file__).with_name("nodes.yaml")


@cache
def default_parameters() -> dict[str, dict[str, Any]]:
    """Parameters by node name."""
    content = read_yaml(NODES_YAML.read_text(encoding="utf-8"), str(NODES_YAML))
    assert isinstance(content, dict)
    return {node: entry["ros__parameters"] for node, entry in content.items()}
