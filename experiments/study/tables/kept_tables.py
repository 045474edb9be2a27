"""Tables of a finished study, read back."""

import csv
import io
from pathlib import Path

from experiments.running.repetitions import Row
from storage.files import read_text


def read_table(folder: Path, name: str) -> list[Row]:
    """Rows of a CSV table by its name, every cell as text."""
    return list(csv.DictReader(io.StringIO(read_text(folder / f"{name}.csv"))))
