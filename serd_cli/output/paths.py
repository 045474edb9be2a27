"""Checks of output paths before a command works for minutes, and numbered output folders."""

from collections.abc import Iterable
from itertools import count
from os.path import lexists
from pathlib import Path

from serd_bag.errors import disk_errors
from serd_cli.errors import UsageError
from serd_files.files import shared_file


def require_suffix(output: Path, *suffixes: str) -> None:
    """UsageError where --output has none of the suffixes, in letters of either case."""
    if output.suffix.lower() not in suffixes:
        raise UsageError(
            f"--output must end in {', '.join(suffixes)}, got {output}; name a {suffixes[0]} file"
        )


def free_folder(output: Path, name: str) -> Path:
    """Make the next free folder `name-N` below `output`; nothing is ever overwritten."""
    for number in count(1):
        root = output / f"{name}-{number}"
        with disk_errors("write", root):
            try:
                root.mkdir(parents=True)
                break
            except FileExistsError:
                if not lexists(root):  # a folder above is a link to nothing
                    raise
    return root


def require_apart(output: Path, written: Iterable[Path], read: Iterable[str | Path]) -> None:
    """UsageError where a file that --output makes the command write is one that it reads."""
    if (path := shared_file(written, read)) is not None:
        raise UsageError(
            f"--output must not overwrite what is read, {output} would overwrite {path};"
            " name another file"
        )
