"""A UTF-8 text file as a string, or one sentence why not."""

from pathlib import Path

from storage.errors import FileError, disk_error


def read_text(path: str | Path) -> str:
    """The text of the file; FileError where it is missing, unreadable or not UTF-8."""
    path = Path(path)
    try:
        return path.read_bytes().decode("utf-8-sig").replace("\r\n", "\n")
    except OSError as error:
        raise disk_error("read", path, error) from None
    except UnicodeDecodeError as error:
        raise FileError(
            f"{path}: must be UTF-8 text, got byte {error.object[error.start]:#04x}"
            f" at offset {error.start}; save it as UTF-8"
        ) from None
