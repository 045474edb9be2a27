"""A program in processes of its own."""

import json
import subprocess
import sys
from typing import Any, TextIO


def outputs_of_processes(program: str, count: int = 2) -> set[str]:
    """The distinct outputs of a Python program that is run several times."""
    command = [sys.executable, "-W", "error", "-c", program]
    return {
        subprocess.run(command, check=True, capture_output=True, text=True).stdout
        for _ in range(count)
    }


def read_json_object(output: TextIO) -> dict[str, Any]:
    """The next object that a command with --json prints, while it still runs."""
    lines = []
    while not lines or lines[-1] != "}\n":
        lines.append(output.readline())
        assert lines[-1], f"the output ended before the object did: {''.join(lines)!r}"
    return dict(json.loads("".join(lines)))
