"""Tables in files that are no text: HDF5 of the Jülich archive and SQLite of JuPedSim, which PedPy
reads, and the folder of JSON of Wild-Track.

Wild-Track has a file per frame with the cell of each person: 480 cells of 2.5 cm by row from
(-3 m, -9 m), frames numbered at 10 per second (Chavdarova et al., CVPR 2018).
"""

import json
from pathlib import Path
from types import ModuleType

import shapely

from serd_bag.errors import FileError
from serd_files.trajectories.columns import Cells

_HDF5, _SQLITE = b"\x89HDF\r\n\x1a\n", b"SQLite format 3\0"
_WILDTRACK_FPS, _CELL_M, _PER_ROW, _ORIGIN_M = 10.0, 0.025, 480, (-3.0, -9.0)


def is_of_database(path: Path) -> bool:
    """Whether a file is HDF5 or SQLite, by its first bytes."""
    return path.is_file() and _kind(path) in (_HDF5, _SQLITE)


def is_wildtrack(path: Path) -> bool:
    """Whether a path is a folder of JSON files with frames as names."""
    files = sorted(path.glob("*.json")) if path.is_dir() else []
    return bool(files) and all(file.stem.isdecimal() for file in files)


def database_cells(path: Path) -> Cells:
    """Return frame, id, x and y (m) of all people; FileError where the file holds none."""
    return _wildtrack(path) if path.is_dir() else _of_pedpy(path)


def _kind(path: Path) -> bytes:
    try:
        with path.open("rb") as file:
            first = file.read(16)
    except OSError:
        return b""
    return _HDF5 if first.startswith(_HDF5) else first


def area_of_database(path: Path) -> shapely.Geometry | None:
    """The walkable area (m) that a file states beside its people, None where it states none."""
    pedpy = _pedpy(path)
    read = (
        pedpy.load_walkable_area_from_ped_data_archive_hdf5
        if _kind(path) == _HDF5
        else pedpy.load_walkable_area_from_jupedsim_sqlite
    )
    try:
        return shapely.from_wkt(read(trajectory_file=path).polygon.wkt)
    except Exception:  # of h5py, SQLite and PedPy, which share no base
        return None


def _pedpy(path: Path) -> ModuleType:
    try:
        import pedpy
    except ModuleNotFoundError:
        raise FileError(
            f"{path} is read by the package pedpy, which is not installed; run: pip install pedpy"
            " (Python 3.11 or later)"
        ) from None
    return pedpy  # type: ignore[no-any-return]


def _of_pedpy(path: Path) -> Cells:
    pedpy, is_hdf5 = _pedpy(path), _kind(path) == _HDF5
    read = (
        pedpy.load_trajectory_from_ped_data_archive_hdf5
        if is_hdf5
        else pedpy.load_trajectory_from_jupedsim_sqlite
    )
    try:
        found = read(trajectory_file=path)
    except Exception as error:  # as above
        what = "HDF5 of the Jülich archive" if is_hdf5 else "SQLite of JuPedSim"
        reason = (str(error).splitlines() or ["it is damaged"])[0]
        raise FileError(
            f"{path} must be {what}, but {reason}; export the table as CSV with frame, id, x and y"
        ) from None
    frame = found.data[["frame", "id", "x", "y"]].reset_index(drop=True)
    return Cells(frame, tuple(frame.columns), {"fps": float(found.frame_rate), "unit": "m"})


def _wildtrack(path: Path) -> Cells:
    import pandas as pd

    rows = [row for file in sorted(path.glob("*.json")) for row in _people_of(file)]
    frame = pd.DataFrame(rows, columns=["frame", "id", "x", "y"])
    return Cells(frame, tuple(frame.columns), {"fps": _WILDTRACK_FPS, "unit": "m"})


def _people_of(file: Path) -> list[tuple[int, int, float, float]]:
    """Return frame, id, x and y of each person of a frame."""
    found = []
    try:
        for person in json.loads(file.read_text()):
            row, column = divmod(int(person["positionID"]), _PER_ROW)
            x_m, y_m = _ORIGIN_M[0] + _CELL_M * column, _ORIGIN_M[1] + _CELL_M * row
            found.append((int(file.stem), int(person["personID"]), x_m, y_m))
    except (OSError, ValueError, KeyError, TypeError):
        raise FileError(
            f"{file} must hold a list of people with personID and positionID, as Wild-Track has;"
            " give a folder of such files alone"
        ) from None
    return found
