"""Tables of trajectories as files, what is read from them, and the mappings that errors show."""

import re
from pathlib import Path

import pandas as pd

from serd_app.drives.mapping import TableMapping
from serd_app.drives.recording import Recording, read_recording
from serd_files.trajectories.columns import TableColumns
from serd_files.trajectories.read import Trajectories, read_trajectories
from serd_files.yaml_config import yaml_model


def read(folder: Path, frame: pd.DataFrame, wanted: TableColumns | None = None) -> Trajectories:
    """Trajectories of a file of the frame."""
    path = folder / "table.csv"
    frame.to_csv(path, index=False)
    return read_trajectories(path, wanted)


def drives(folder: Path, frame: pd.DataFrame, mapping: str = "") -> Recording:
    """Drives of a file of the frame; mapping: its text."""
    path = folder / "table.csv"
    frame.to_csv(path, index=False)
    chosen = yaml_model(mapping, TableMapping, name="mapping") if mapping else TableMapping()
    return read_recording(path, mapping=chosen, tolerant=False)


def mappings_in(error: BaseException) -> list[str]:
    """The mappings that an error shows."""
    return re.findall(r"\{[^}]*\}", str(error))
