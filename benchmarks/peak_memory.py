"""The most memory this process has held.

Not `ru_maxrss`: over fork and exec a process takes that of the one which started it along.
"""

import re
from pathlib import Path


def peak_memory_mb() -> float:
    """Peak of the resident memory in MB (2^20 bytes), as Linux keeps it in /proc."""
    status = Path("/proc/self/status").read_text()
    found = re.search(r"^VmHWM:\s*(\d+) kB", status, re.MULTILINE)
    if found is None:
        raise RuntimeError("/proc/self/status must hold VmHWM; measure on Linux")
    return int(found[1]) / 1024
