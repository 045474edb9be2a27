"""The page of `serd look`: one HTML file with map, time line, tables, and nothing from outside."""

import base64
import json
from collections.abc import Iterator
from io import BytesIO
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from PIL import Image

from serd_app.learning.criticism import interval_text
from serd_app.report.inputs import in_words
from serd_app.report.look import Looked
from serd_bag.files import atomic_write_text
from serd_bag.quantities import seconds_in_words
from serd_core.arrays import FloatArray

#: Points of a track and times of the time line that are drawn.
_MOST_POINTS, _MOST_TIMES = 700, 500
#: Speeds are drawn in so many shades.
_SHADES = 5
_MARGIN_M = 0.5
_CHART_WIDTH, _CHART_HEIGHT = 720.0, 150.0


def write_look(found: Looked, output: Path) -> Path:
    """Write the page and return its path."""
    page = Path(output).resolve() / "look.html"
    page.parent.mkdir(parents=True, exist_ok=True)
    atomic_write_text(page, look_page(found))
    return page


def look_page(found: Looked) -> str:
    """Return the page as text."""
    environment = Environment(
        loader=PackageLoader("serd_app.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"in_words": in_words, "seconds": seconds_in_words}
    low, high = _bounds_m(found)
    return environment.get_template("look.html.j2").render(
        found=found,
        low=low,
        size=high - low,
        middle=(low + high) / 2,
        image=_image(found),
        tracks=[list(_pieces(track, _fastest_mps(found))) for track in found.tracks_m],
        fastest_mps=_fastest_mps(found),
        ends=[(track[0, 1:], track[-1, 1:]) for track in found.tracks_m],
        people=_thinned(found.people, 3 * _MOST_POINTS)[:, 1:].round(2).tolist(),
        bar_m=_bar_m(float((high - low)[0])),
        outcomes=list(_outcome_rows(found)),
        chart=_chart(found),
        timeline=json.dumps(_timeline(found)),
    )


def _thinned(rows: FloatArray, most: int) -> FloatArray:
    return rows[:: 1 + len(rows) // most]


def _bounds_m(found: Looked) -> tuple[FloatArray, FloatArray]:
    """The corners of what is drawn."""
    points = [track[:, 1:] for track in found.tracks_m]
    if found.place is not None:
        rows, columns = np.nonzero(found.place.log_odds)
        if len(rows):
            ends = np.array([[columns.min(), rows.min()], [columns.max() + 1, rows.max() + 1]])
            points.append(np.array(found.place.origin_m) + found.place.cell_m * ends)
    if not points:
        points = [np.array([[0.0, 0.0], [1.0, 1.0]])]
    every = np.concatenate(points)
    return every.min(axis=0) - _MARGIN_M, every.max(axis=0) + _MARGIN_M


def _image(found: Looked) -> dict[str, Any] | None:
    """The map as PNG with its place in metres: opaque where occupied, clear where unknown."""
    if found.place is None:
        return None
    place = found.place
    share = 1.0 / (1.0 + np.exp(-place.log_odds))
    pixels = np.zeros((*share.shape, 4), dtype=np.uint8)
    occupied, free = share > 0.6, share < 0.4
    pixels[occupied] = (85, 96, 107, 255)
    pixels[free] = (150, 160, 170, 40)
    buffer = BytesIO()
    Image.fromarray(pixels[::-1]).save(buffer, "PNG")
    height, width = np.array(share.shape) * place.cell_m
    x_m, y_m = place.origin_m
    data = base64.b64encode(buffer.getvalue()).decode()
    return {"data": data, "x": x_m, "y": y_m, "width": width, "height": height}


def _fastest_mps(found: Looked) -> float:
    speeds = [_speeds_mps(track) for track in found.tracks_m if len(track) > 2]
    return float(np.quantile(np.concatenate(speeds), 0.98)) if speeds else 0.0


def _speeds_mps(track: FloatArray) -> FloatArray:
    """(T - 1,) mean speed of about a second around each step."""
    time_s, place_m = track[:, 0], track[:, 1:]
    middle_s = (time_s[1:] + time_s[:-1]) / 2
    early_s, late_s = (np.clip(middle_s + d, time_s[0], time_s[-1]) for d in (-0.5, 0.5))
    early, late = (
        np.column_stack([np.interp(at, time_s, axis) for axis in place_m.T])
        for at in (early_s, late_s)
    )
    return np.asarray(np.hypot(*(late - early).T) / np.maximum(late_s - early_s, 1e-6))


def _pieces(track: FloatArray, fastest_mps: float) -> Iterator[tuple[int, str]]:
    """Runs of points of one shade of speed, as points of a polyline."""
    track = _thinned(track, _MOST_POINTS)
    if len(track) < 2:
        return
    shade = np.minimum(_SHADES * _speeds_mps(track) / max(fastest_mps, 1e-9), _SHADES - 1)
    shade = shade.astype(np.int64)
    edges = [0, *(np.flatnonzero(np.diff(shade)) + 1), len(shade)]
    for start, stop in pairwise(edges):
        points = track[start : stop + 1, 1:]
        yield int(shade[start]), " ".join(f"{x:.3f},{y:.3f}" for x, y in points)


def _bar_m(width_m: float) -> float:
    """A length for the scale bar, about a fifth of the width."""
    size = 10.0 ** np.floor(np.log10(width_m / 5))
    return float(size * max(each for each in (1, 2, 5) if each * size <= width_m / 5))


def _outcome_rows(found: Looked) -> Iterator[tuple[str, int, str, float]]:
    total = sum(found.outcomes.values())
    for name in ("forward", "left", "right", "back", "stay"):
        count = found.outcomes.get(name, 0)
        if total:
            yield name, count, interval_text(count, total), 100 * count / total


def _chart(found: Looked) -> dict[str, Any] | None:
    """Speed over time, measured and commanded, as points in a box of 720 by 150."""
    if not found.tracks_m:
        return None
    from_s = min(float(track[0, 0]) for track in found.tracks_m)
    until_s = max(float(track[-1, 0]) for track in found.tracks_m)
    top = max(_fastest_mps(found), float(found.commands[:, 1].max(initial=0.0)), 1e-3) * 1.1

    def points(time_s: FloatArray, mps: FloatArray) -> str:
        x = _CHART_WIDTH * (time_s - from_s) / max(until_s - from_s, 1e-9)
        y = _CHART_HEIGHT * (1.0 - np.clip(mps, 0.0, top) / top)
        return " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))

    lines = [
        points(*_thinned(np.column_stack([track[1:, 0], _speeds_mps(track)]), _MOST_POINTS).T)
        for track in found.tracks_m[:40]
        if len(track) > 2
    ]
    sent = found.commands
    sent = _thinned(sent[(sent[:, 0] >= from_s) & (sent[:, 0] <= until_s)], 2 * _MOST_POINTS)
    steps = np.repeat(sent, 2, axis=0)
    return {
        "lines": lines,
        "commands": points(steps[1:, 0], steps[:-1, 1]) if len(sent) > 1 else "",
        "top": top,
        "span": until_s - from_s,
    }


def _timeline(found: Looked) -> dict[str, Any]:
    """Seconds from the begin, the places of the robot then, and of people about then."""
    if not found.tracks_m:
        return {"times": [], "places": [], "people": []}
    track = np.concatenate(found.tracks_m)
    track = _thinned(track[np.argsort(track[:, 0], kind="stable")], _MOST_TIMES)
    begin_s = track[0, 0]
    people = found.people[np.argsort(found.people[:, 0], kind="stable")]
    shown = []
    for time_s in track[:, 0]:
        first, last = np.searchsorted(people[:, 0], (time_s - 0.25, time_s + 0.25))
        near = people[first:last]
        if len(near):
            near = near[near[:, 0] == near[np.abs(near[:, 0] - time_s).argmin(), 0]]
        shown.append(near[:60, 1:].round(2).tolist())
    return {
        "times": (track[:, 0] - begin_s).round(2).tolist(),
        "places": track[:, 1:].round(3).tolist(),
        "people": shown,
    }
