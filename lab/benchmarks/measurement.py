"""Processor time and peak memory of this process.

Processor time is what is left of a timing when other work shares the machine. Peak memory is not
`ru_maxrss`: over fork and exec a process inherits that of its parent.
"""

import re
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np


def best_of(work: Callable[[], Any], at_least_s: float = 1.0, calls: int = 1) -> tuple[float, Any]:
    """Least processor seconds of repeated calls, and the last result.

    Called for at_least_s seconds of processor time, and at least `calls` times.
    """
    processor_s, _, result = best_times(work, at_least_s, calls)
    return processor_s, result


def best_times(
    work: Callable[[], Any], at_least_s: float = 1.0, calls: int = 1
) -> tuple[float, float, Any]:
    """The same with the least seconds that passed; one result at a time is held."""
    times: list[tuple[float, float]] = []
    result = None
    while sum(processor_s for processor_s, _ in times) < at_least_s or len(times) < calls:
        del result
        start_s, began_s = time.process_time(), time.perf_counter()
        result = work()
        times.append((time.process_time() - start_s, time.perf_counter() - began_s))
    processor_s, elapsed_s = np.min(times, axis=0)
    return float(processor_s), float(elapsed_s), result


def peak_memory_mb() -> float:
    """Peak of the resident memory in MB (2^20 bytes), as Linux keeps it in /proc."""
    status = Path("/proc/self/status").read_text()
    found = re.search(r"^VmHWM:\s*(\d+) kB", status, re.MULTILINE)
    if found is None:
        raise RuntimeError("/proc/self/status must hold VmHWM; measure on Linux")
    return int(found[1]) / 1024
