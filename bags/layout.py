"""Which files make up a bag, with or without its metadata.yaml."""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from bags.errors import BagError
from bags.metadata_file import FILE_NAME, ROOT_KEY
from storage.errors import FileError
from storage.text_file import read_text

_SUFFIXES = (".mcap", ".db3")


@dataclass(frozen=True)
class BagLayout:
    """metadata: what stands below the root key of metadata.yaml, None where there is none.

    fault: why metadata.yaml is missing or not believed, empty where it is well.
    """

    path: Path
    files: tuple[Path, ...]
    metadata: dict[str, Any] | None
    fault: str = ""

    @property
    def plain_mcap(self) -> bool:
        """Whether the files are MCAP and not compressed as a whole."""
        return all(file.suffix == ".mcap" for file in self.files) and not (self.metadata or {}).get(
            "compression_mode"
        )


def bag_layout(path: str | Path) -> BagLayout:
    """The layout of a bag folder or of a single storage file; BagError where there is no bag."""
    path = Path(path)
    if path.is_file() and path.suffix in _SUFFIXES:
        return BagLayout(path, (path,), None)
    if not path.is_dir():
        raise BagError(f"bag {path} must be a folder or a .mcap or .db3 file; check the path")
    try:
        metadata = _metadata(path)
        return BagLayout(path, _listed(path, metadata), metadata)
    except FileError as error:
        files = _found(path)
        if not files:
            kinds = " or ".join(_SUFFIXES)
            raise BagError(f"bag {path} must hold {kinds} files, got none; {error}") from None
        return BagLayout(path, files, None, str(error))


def _metadata(path: Path) -> dict[str, Any]:
    text = read_text(path / FILE_NAME)
    try:
        values = yaml.safe_load(text)[ROOT_KEY]
        names = values["relative_file_paths"]
        if not isinstance(values, dict) or not all(isinstance(name, str) for name in names):
            raise TypeError("relative_file_paths must be a list of names")
    except (yaml.YAMLError, KeyError, TypeError, RecursionError, ValueError) as error:
        reason = str(error).splitlines()[0]
        raise BagError(f"{path / FILE_NAME} is no rosbag2 metadata ({reason})") from None
    return dict(values)


def _listed(path: Path, metadata: dict[str, Any]) -> tuple[Path, ...]:
    files = tuple(path / Path(name).name for name in metadata["relative_file_paths"])
    missing = [file.name for file in files if not file.is_file()]
    if missing:
        raise BagError(f"{path / FILE_NAME} lists {missing[0]}, which is missing")
    unlisted = sorted({file.name for file in _found(path)} - {file.name for file in files})
    if unlisted and files:
        raise BagError(f"{path / FILE_NAME} does not list {unlisted[0]}")
    return files


def _found(path: Path) -> tuple[Path, ...]:
    files = (file for file in path.iterdir() if file.suffix in _SUFFIXES)
    return tuple(sorted(files, key=_by_number))


def _by_number(file: Path) -> tuple[int, str]:
    number = re.search(r"_(\d+)$", file.stem)
    return int(number[1]) if number else 0, file.name
