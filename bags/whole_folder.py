"""A folder that appears under its name only once it is whole.

It is filled under the same name inside a hidden folder beside it and then moved; what a killed
process leaves behind is hidden and never passes for a finished bag.
"""

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from bags.errors import BagError
from storage.errors import disk_error


@contextmanager
def whole_folder(target: Path) -> Iterator[Path]:
    """The folder to fill; moved to `target` at the end, removed where filling it failed.

    BagError where `target` holds something already or the disk refuses.
    """
    target = target.resolve()
    hidden = _hidden_beside(target)
    try:
        filling = hidden / target.name
        yield filling
        filling.replace(target)
    except OSError as error:
        raise BagError(str(disk_error("write", target, error))) from None
    finally:
        shutil.rmtree(hidden, ignore_errors=True)


def _hidden_beside(target: Path) -> Path:
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        occupied = target.exists() and (not target.is_dir() or any(target.iterdir()))
        if not occupied:
            return Path(tempfile.mkdtemp(prefix=f".{target.name}-", dir=target.parent))
    except OSError as error:
        raise BagError(str(disk_error("write", target, error))) from None
    raise BagError(f"bag folder {target} must be new or empty; choose another name")
