"""What every crowd peer is given and how it is timed; needs nothing but Python and JSON.

The task: people start on a lattice of a closed corridor and walk to its other end, in steps of
`step_s`. A block is sixty steps, or what fits into two seconds; the fastest of three counts.
"""

import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

WARM_UP_STEPS, BLOCK_STEPS, BLOCK_S, BLOCKS = 5, 60, 2.0, 3


def read_task() -> dict[str, Any]:
    """The task named on the command line: width_m, length_m, step_s and the people's state."""
    task: dict[str, Any] = json.loads(Path(sys.argv[1]).read_text())
    return task


def answer(simulator: str, step_seconds: dict[str, float]) -> None:
    """Write seconds by what is computed to the file named on the command line."""
    rows = [
        {"simulator": simulator, "computes": computes, "step_seconds": seconds}
        for computes, seconds in step_seconds.items()
    ]
    Path(sys.argv[2]).write_text(json.dumps(rows))


def seconds_per_step(step: Callable[[], object]) -> float:
    """Of the fastest block."""
    for _ in range(WARM_UP_STEPS):
        step()
    return min(_seconds_of_block(step) for _ in range(BLOCKS))


def _seconds_of_block(step: Callable[[], object]) -> float:
    start = time.perf_counter()
    count, passed = 0, 0.0
    while count < BLOCK_STEPS and passed < BLOCK_S:
        step()
        count += 1
        passed = time.perf_counter() - start
    return passed / count
