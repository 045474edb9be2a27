"""A program in processes of its own."""

import subprocess
import sys


def outputs_of_processes(program: str, count: int = 2) -> set[str]:
    """The distinct outputs of a Python program that is run several times."""
    command = [sys.executable, "-W", "error", "-c", program]
    return {
        subprocess.run(command, check=True, capture_output=True, text=True).stdout
        for _ in range(count)
    }
