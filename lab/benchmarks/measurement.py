"""Processor time and peak memory of this process.

Processor time is what is left of a timing when other work shares the machine. Peak memory is not
`ru_maxrss`: over fork and exec a process inherits that of its parent.
"""

import re
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any


def best_of(work: Callable[[], Any], at_least_s: float = 1.0, calls: int = 1) -> tuple[float, Any]:
    """Least processor seconds of repeated calls, and the last result.

    Called for at_least_s seconds of processor time, and at least `calls` times.
    """
    times: list[float] = []
    result = None
    while sum(times) < at_least_s or len(times) < calls:
        del result  # one result at a time is held
        start_s = time.process_time()
        result = work()
        times.append(time.process_time() - start_s)
    return min(times), result


def peak_memory_mb() -> float:
    """Peak of the resident memory in MB (2^20 bytes), as Linux keeps it in /proc."""
    status = Path("/proc/self/status").read_text()
    found = re.search(r"^VmHWM:\s*(\d+) kB", status, re.MULTILINE)
    if found is None:
        raise RuntimeError("/proc/self/status must hold VmHWM; measure on Linux")
    return int(found[1]) / 1024
