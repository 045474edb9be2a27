"""Results as JSON on stdout, for programs to read."""

import json
from typing import Any


def print_json(values: Any) -> None:
    """Print plain values; paths become text, and numbers that are not finite are refused."""
    print(json.dumps(values, indent=2, ensure_ascii=False, allow_nan=False, default=str))
