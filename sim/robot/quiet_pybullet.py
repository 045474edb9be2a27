"""PyBullet without the greeting it writes to standard error when imported."""

import os
import sys
from typing import Any

_STANDARD_ERROR = 2


def import_pybullet() -> Any:
    """The pybullet module; what its import writes to standard error is thrown away."""
    sys.stderr.flush()
    kept = os.dup(_STANDARD_ERROR)
    null = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(null, _STANDARD_ERROR)
        import pybullet
    finally:
        os.dup2(kept, _STANDARD_ERROR)
        os.close(kept)
        os.close(null)
    return pybullet


pybullet = import_pybullet()
