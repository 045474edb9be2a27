"""Which columns of a table are time, agent, x and y, and in which units.

Columns are found by their names, or without names by their values: ids and frames are whole
numbers, and along the right id the steps are short. What is assumed is listed in sentences.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import yaml

from serd_bag.errors import FileError
from serd_core.arrays import FloatArray
from serd_files.settings import setting
from serd_files.yaml_config import StrictModel

if TYPE_CHECKING:
    import pandas as pd

Unit = Literal["m", "cm", "mm"]
METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001}
_SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
#: Other spellings of units at the end of names.
_SPELLINGS = {
    "m": "m meters metres meter metre",
    "cm": "cm",
    "mm": "mm",
    "s": "s sec secs seconds",
    "ms": "ms msec millis",
    "us": "us usec micros",
    "ns": "ns nsec nanos nanosec",
}
_UNIT_OF = {spelling: unit for unit, all_ in _SPELLINGS.items() for spelling in all_.split()}
_NAMES = {
    "frame": "frame frame_id frame_number frame_num frame_no frame_nr frameid framenumber fr"
    " frameno bild bildnummer einzelbild trame image fotograma cuadro",
    "time": "t time timestamp stamp sec secs second seconds timestep datetime date_time simtime"
    " sim_time rosbagtimestamp time_stamp elapsed __time zeit temps tiempo tempo",
    "agent": "id ped ped_id pedid pedestrian pedestrian_id person person_id personid agent agent_id"
    " agentid track track_id trackid tid object object_id obj_id objectid vehicle vehicle_id uid"
    " pid persid pers_id ped_nr person_nr tr_id traj_id trajectory_id name robot robot_id user"
    " user_id walker participant subject personennummer personen_id person_nummer fussgaenger"
    " fußgänger personne pieton piéton persona peaton peatón entity entity_id actor actor_id",
    "episode": "episode episode_id episode_nr episode_no run run_id run_nr trial trial_id scene"
    " scene_id sequence sequence_id seq_id session session_id recording recording_id experiment"
    " experiment_id clip clip_id demo demo_id rollout rollout_id",
    "x": "x pos_x posx px x_pos xpos position_x x_position tx xcenter x_center center_x x_est"
    " local_x world_x x_world pose_x x_coord coord_x easting utm_x xloc loc_x map_x x_map global_x"
    " x_global centroid_x",
    "y": "y pos_y posy py y_pos ypos position_y y_position ty ycenter y_center center_y y_est"
    " local_y world_y y_world pose_y y_coord coord_y northing utm_y yloc loc_y map_y y_map global_y"
    " y_global centroid_y",
}
NAMES_OF_AXES = {axis: _NAMES[axis].split() for axis in ("x", "y")}
_ROLE_OF = {name: role for role, names in _NAMES.items() for name in names.split()}
_POSITION = re.compile(r"(?:^|[./_])(?:position|translation|pos|p_[a-z_]+)[./_ ]+([xy])$")
_UNITS = "|".join(_UNIT_OF)
UNIT_SUFFIX = re.compile(rf"[\[(/]\s*({_UNITS})\s*[\])]?\s*$|_({_UNITS})$")
_LARGEST_FRAME = 1e8
#: Median times above which they are since 1970, and so their unit is known.
_SINCE_1970 = 5e8
_LONGEST_STEP_S = 60.0
_QUATERNION, _MATRIX = slice(4, 8), 12
#: Steps between frames, as annotated; each stands for 0.4 s in the ETH and UCY data.
_ANNOTATED_STEPS, _ANNOTATED_S = (6.0, 10.0, 12.0), 0.4
_USUAL_FPS, _KITTI_FPS = 25.0, 10.0
#: Median speeds above which places are in cm, and in mm; no one walks that fast in m/s.
_CM_ABOVE, _MM_ABOVE = 12.0, 250.0
#: Usual steps between whole numbers above which these are times in ms, us and ns.
_STEPS_OF_UNITS = ((9e6, "ns"), (9e3, "us"), (15.0, "ms"))


class TableColumns(StrictModel):
    """Names of the columns, or their numbers from 1; empty: found by names or values."""

    time: str = setting("", "column of times or frames: its name, or its number from 1")
    agent: str = setting("", "column of ids")
    episode: str = setting("", "column of episodes, in each of which ids and times may begin again")
    x: str = setting("", "column of x; where people have columns of their own, that of the robot")
    y: str = setting("", "column of y, likewise")
    fps: float | None = setting(None, "frames per second, where times are frames", unit="Hz", gt=0)
    time_unit: Literal["s", "ms", "us", "ns"] | None = setting(None, "unit of times")
    unit: Unit | None = setting(None, "unit of x and y")


@dataclass(frozen=True)
class Columns:
    """Indices of columns; agent: -1 for a single one, time: -1 for one row per frame, episode: -1
    for one.

    frames: whether the time is a number of frames; time_s, place_m: units, None where unknown.
    """

    time: int
    agent: int
    x: int
    y: int
    frames: bool = False
    time_s: float | None = None
    place_m: float | None = None
    assumed: tuple[str, ...] = ()
    episode: int = -1


def located(where: str, names: Sequence[str], values: FloatArray, wanted: TableColumns) -> Columns:
    """The columns; FileError where x, y or time cannot be found. values: (R, C), text as NaN."""
    by_name = columns_by_name(names)
    by_name |= {
        role: column_named(where, names, values.shape[1], text, role)
        for role in ("time", "agent", "episode", "x", "y")
        if (text := getattr(wanted, role))
    }
    if "x" in by_name and "y" in by_name and ("time" in by_name or "frame" in by_name):
        found = _of_names(names, values, by_name, has_rate=wanted.fps is not None)
    elif names or by_name:
        known = by_name.keys() | ({"time"} if "frame" in by_name else set())
        missing = [each for each in ("time", "x", "y") if each not in known]
        raise FileError(
            f"{where} must have columns of time, x and y, {' and '.join(missing)}"
            f" {'is' if len(missing) == 1 else 'are'} not among"
            f" {', '.join(names) or 'those named'}; name the columns in a --mapping file"
            " (time:, agent:, x:, y:)"
        )
    else:
        found = _of_values(where, values)
    if wanted.time_unit is None:
        return found
    return replace(found, frames=False, time_s=_SECONDS[wanted.time_unit])


def role_of(name: str) -> str | None:
    """What the name of a column stands for: frame, time, agent, episode, x or y."""
    plain = UNIT_SUFFIX.sub("", name.strip().lower()).strip(" _%#")
    plain = re.sub(r"[\s-]+", "_", plain)
    position = _POSITION.search(plain)
    return _ROLE_OF.get(plain) or (position[1] if position else None)


def columns_by_name(names: Sequence[str]) -> dict[str, int]:
    """Return the first column of each role that the names have."""
    found: dict[str, int] = {}
    for index, name in enumerate(names):
        role = role_of(name)
        if role is not None:
            found.setdefault(role, index)
    if not ("time" in found or "frame" in found):
        stamps = [index for index, name in enumerate(names) if "time" in name.lower()]
        found.update({"time": stamps[0]} if stamps else {})
    return found


def require_one_time(where: str, names: Sequence[str], frame: "pd.DataFrame") -> None:
    """Raise FileError if several columns of numbers may be the times and do not agree.

    Two columns agree if one is the other in another unit or from another start.
    """
    times = [column for column, name in enumerate(names) if role_of(name) == "time"]
    clocks = {
        column: numbers
        for column in (times if len(times) > 1 else ())
        for numbers in [numeric(frame.iloc[:, column]).to_numpy(np.float64)]
        if np.isfinite(numbers).sum() > 1 and np.ptp(numbers[np.isfinite(numbers)]) > 0
    }
    if len(clocks) < 2 or all(_agree(clocks[min(clocks)], each) for each in clocks.values()):
        return
    listed = " and ".join(names[column] for column in clocks)
    mappings = " or ".join(mapping_of(names, time=column) for column in clocks)
    raise FileError(
        f"{where} must have one column of times, it has {listed}, whose values differ; write one of"
        f" them into a --mapping file: {mappings}"
    )


def numeric(column: "pd.Series[Any]") -> "pd.Series[Any]":
    """Return the numbers of a column, NaN for what is no number."""
    import pandas as pd

    try:
        return pd.to_numeric(column, errors="coerce")
    except OverflowError:  # an integer of more than 308 digits
        return pd.to_numeric(column.where(column.astype(str).str.len() < 300), errors="coerce")


def _agree(one: FloatArray, other: FloatArray) -> bool:
    known = np.isfinite(one) & np.isfinite(other)
    shares = [(each[known] - each[known].min()) / max(np.ptp(each[known]), 1e-300)
              for each in (one, other)] if known.sum() > 1 else []  # fmt: skip
    if not shares:
        return False
    steps = np.diff(np.unique(shares[0]))
    return bool(np.abs(shares[0] - shares[1]).max() < np.median(steps))


def mapping_of(names: Sequence[str], **columns: int) -> str:
    """Return what a mapping file must hold to name these columns.

    >>> mapping_of(["t", "robot_x", "robot_y"], x=1, y=2)
    '{x: robot_x, y: robot_y}'

    Columns of equal names are named by their numbers.
    """
    chosen = {
        key: names[column] if list(names).count(names[column]) == 1 else str(column + 1)
        for key, column in columns.items()
    }
    text = yaml.safe_dump(chosen, default_flow_style=True, width=10_000, allow_unicode=True)
    return str(text).strip()


def column_named(where: str, names: Sequence[str], count: int, text: str, role: str) -> int:
    """Return the column that a mapping names for a role; FileError if the table has none such."""
    if text in names:
        return list(names).index(text)
    if text.isdecimal() and 1 <= int(text) <= count:
        return int(text) - 1
    raise FileError(
        f"{where}: {role} must be one of the columns {', '.join(names) or f'1 to {count}'}, got"
        f" {text!r}; correct the mapping"
    )


def _of_names(
    names: Sequence[str], values: FloatArray, found: dict[str, int], *, has_rate: bool
) -> Columns:
    is_frame = "time" not in found
    time = found["frame"] if is_frame else found["time"]
    unit = unit_of(names[time], _SECONDS) if names else None
    may_count = unit is None and (has_rate or not names)
    return Columns(
        time=time,
        agent=found.get("agent", -1),
        episode=found.get("episode", -1),
        x=found["x"],
        y=found["y"],
        frames=is_frame or (may_count and _are_frames(values[:, time])),
        time_s=None if is_frame else unit,
        place_m=unit_of(names[found["x"]], METRES) if names else None,
    )


def unit_of(name: str, known: dict[str, float]) -> float | None:
    """Return the factor of the unit at the end of a name, or None if it states no unit."""
    found = UNIT_SUFFIX.search(name.strip().lower())
    return known.get(_UNIT_OF[found[1] or found[2]]) if found else None


def _of_values(where: str, values: FloatArray) -> Columns:
    """Of a table without names."""
    count = values.shape[1]
    if count in (_MATRIX, _MATRIX + 1):
        return _of_matrices(values, count - _MATRIX)
    if count >= _QUATERNION.stop and _are_quaternions(values[:, _QUATERNION]):
        x, y = _ground(values, (1, 2, 3))
        plane = "" if (x, y) == (1, 2) else "the ground is taken as the plane of x and z"
        return Columns(0, -1, x, y, place_m=1.0, assumed=(plane,) if plane else ())
    whole = [_are_whole(values[:, column]) for column in range(min(count, 2))]
    if count >= 4 and all(whole):
        return _of_frames(values)
    if count >= 4 and whole[1]:
        return Columns(0, 1, 2, 3, assumed=("columns are taken as time, agent, x, y",))
    if count >= 4 and whole[0] and not (np.diff(values[:, 0]) > 0).all():
        return Columns(1, 0, 2, 3, assumed=("columns are taken as agent, time, x, y",))
    if count >= 3:
        return Columns(
            0,
            -1,
            1,
            2,
            frames=_are_frames(values[:, 0]),
            assumed=("columns are taken as time, x, y",),
        )
    raise FileError(
        f"{where} must have columns of time, x and y, got {count} without names; name the columns"
        " in its first line"
    )


def _of_matrices(values: FloatArray, before: int) -> Columns:
    """Poses as rows of 3 x 4 matrices, as KITTI has them: place in columns 4, 8 and 12."""
    x, y = _ground(values, (before + 3, before + 7, before + 11))
    plane = "x and y" if y == before + 7 else "x and z"
    assumed = (f"rows are taken as matrices of poses, the ground as the plane of {plane}",)
    frames = not before or _are_frames(values[:, 0])
    return Columns(0 if before else -1, -1, x, y, frames, place_m=1.0, assumed=assumed)


def _ground(values: FloatArray, axes: tuple[int, int, int]) -> tuple[int, int]:
    """x and y, or x and z of a camera, whose y points down."""
    x, y, z = axes
    spread = np.ptp(values[:, [x, y, z]], axis=0)
    return (x, z) if 3.0 * spread[1] < min(spread[0], spread[2]) else (x, y)


def _of_frames(values: FloatArray) -> Columns:
    """Two columns of whole numbers: the agent is the one along which the steps are shorter.

    Eight columns with a constant fourth are frame, agent, x, z, y and velocities (ETH).
    """
    x, y = (2, 4) if values.shape[1] == 8 and np.ptp(values[:, 3]) == 0.0 else (2, 3)
    agent_first = _step(values, 0, 1, x, y) < _step(values, 1, 0, x, y)
    agent, frame = (0, 1) if agent_first else (1, 0)
    order = "agent, frame" if agent_first else "frame, agent"
    frames = _are_frames(values[:, frame])
    return Columns(
        frame,
        agent,
        x,
        y,
        frames,
        assumed=(f"columns are taken as {order}, x, {'z, ' * (y - 3)}y",),
    )


def _step(values: FloatArray, agent: int, frame: int, x: int, y: int) -> float:
    """Median distance from row to row of one agent; infinite where there are no two."""
    rows = values[np.lexsort((values[:, frame], values[:, agent]))]
    same = (np.diff(rows[:, agent]) == 0) & (np.diff(rows[:, frame]) > 0)
    steps = np.hypot(*np.diff(rows[:, [x, y]], axis=0)[same].T)
    return float(np.median(steps)) if len(steps) else np.inf


def _are_whole(column: FloatArray) -> bool:
    known = column[np.isfinite(column)]
    return bool(len(known)) and bool((known == np.floor(known)).all())


def _are_frames(column: FloatArray) -> bool:
    return _are_whole(column) and bool(np.nanmax(np.abs(column)) < _LARGEST_FRAME)


def _are_quaternions(columns: FloatArray) -> bool:
    norms = np.linalg.norm(columns, axis=1)
    return bool(np.mean(np.abs(norms - 1.0) < 0.02) > 0.9)


def times_of(
    columns: Columns, numbers: FloatArray, steps: FloatArray, fps: float | None
) -> tuple[FloatArray, dict[str, str]]:
    """(R,) seconds, and what of their unit is assumed, by the key that states it.

    steps: between rows of one agent, in the units of the file.
    """
    usual = float(np.median(steps)) if len(steps) else 1.0
    if not columns.frames:
        if columns.time_s is not None:
            return numbers * columns.time_s, {}
        scale = _scale_of_stamps(numbers)
        if scale * np.nanmedian(np.abs(numbers)) > _SINCE_1970 and usual * scale < _LONGEST_STEP_S:
            return numbers * scale, {}
        units = (unit for least, unit in _STEPS_OF_UNITS if usual > least)
        unit = next(units, "s") if _are_whole(numbers) else "s"
        return numbers * _SECONDS[unit], {"time_unit": f"times in {unit}"}
    if fps is not None:
        return numbers / fps, {}
    if columns.time < 0:
        return numbers / _KITTI_FPS, {"fps": f"{_KITTI_FPS:g} rows per second"}
    if usual in _ANNOTATED_STEPS:
        note = f"{usual:g} frames in {_ANNOTATED_S:g} s, as in the ETH and UCY data,"
        return numbers * _ANNOTATED_S / usual, {"fps": note}
    return numbers / _USUAL_FPS, {"fps": f"{_USUAL_FPS:g} frames per second"}


def _scale_of_stamps(numbers: FloatArray) -> float:
    """Unix times are recognised by their size: s, ms, us or ns."""
    size = float(np.nanmedian(np.abs(numbers)))
    return next(
        (scale for least, scale in ((1e17, 1e-9), (1e14, 1e-6), (1e11, 1e-3)) if size > least), 1.0
    )


def metres_of(columns: Columns, speed: float, unit: Unit | None) -> tuple[float, dict[str, str]]:
    """m per unit, and what of it is assumed, by the key that states it.

    speed: median of moving agents, in units per second.
    """
    if unit is not None:
        return METRES[unit], {}
    if columns.place_m is not None:
        return columns.place_m, {}
    guess: Unit = "mm" if speed > _MM_ABOVE else "cm" if speed > _CM_ABOVE else "m"
    return METRES[guess], {"unit": f"places in {guess}"}
