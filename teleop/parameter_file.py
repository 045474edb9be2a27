"""A YAML file that may be a ROS parameter file: its `NODE: ros__parameters:` frame comes off."""

from pathlib import Path
from typing import Any

from storage.files import read_text
from storage.yaml_text import read_yaml

_FRAME = "ros__parameters"


def read_parameters(path: Path) -> Any:
    """Plain values of the file; FileError where it is no YAML."""
    values = read_yaml(read_text(path), str(path))
    if isinstance(values, dict) and len(values) == 1:
        inner = next(iter(values.values()))
        if isinstance(inner, dict) and _FRAME in inner:
            return inner[_FRAME]
    return values
