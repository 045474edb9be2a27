"""A folder of its own for every run: NAME-1, NAME-2, ...; nothing is ever overwritten."""

from itertools import count
from pathlib import Path

from storage.errors import disk_error


def free_folder(output: Path, name: str) -> Path:
    """Make the next free `name-N` below `output`; FileError where the disk refuses."""
    for number in count(1):
        root = output / f"{name}-{number}"
        try:
            root.mkdir(parents=True)
        except FileExistsError:
            continue
        except OSError as error:
            raise disk_error("write", root, error) from None
        break
    return root
