"""A folder of its own for every run: NAME-1, NAME-2, ...; nothing is ever overwritten."""

from itertools import count
from pathlib import Path

from serd_cli.errors import UsageError
from storage.errors import disk_error


def free_folder(output: Path, name: str) -> Path:
    """Make the next free `name-N` below `output`."""
    for number in count(1):
        root = output / f"{name}-{number}"
        try:
            root.mkdir(parents=True)
        except FileExistsError:
            if not output.is_dir():
                raise UsageError(f"{output} is a file; give a folder for the output") from None
        except OSError as error:
            raise disk_error("write", root, error) from None
        else:
            break
    return root
