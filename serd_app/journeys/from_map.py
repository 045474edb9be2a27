"""From the map that a robot navigates by to a scenario: what `serd scenario from-map` does."""

from dataclasses import dataclass
from pathlib import Path

import shapely

from serd_app.errors import AppError
from serd_app.places.free_area import free_area_m, is_area_file, read_area_m
from serd_app.places.map_scenario import map_scenario_yaml
from serd_app.places.ros_map import read_map
from serd_app.places.settings import PlaceSettings
from serd_bag.files import atomic_write_text, read_text
from serd_files.yaml_config import yaml_model
from serd_sim.scenario.occupancy import OccupancyRaster
from serd_sim.scenario.scenario import Scenario


@dataclass(frozen=True, eq=False)
class MappedScenario:
    """A scenario that was made of a map, and its files.

    area: what is free; raster: the map, None for an area of polygons.
    """

    scenario: Scenario
    area: shapely.Polygon
    raster: OccupancyRaster | None
    file: Path
    picture: Path


def scenario_from_map(
    source: Path,
    file: Path,
    settings: PlaceSettings,
    *,
    goal_m: tuple[float, float] | None = None,
    start_m: tuple[float, float] | None = None,
    replace: bool = False,
) -> MappedScenario:
    """Write a scenario and, as PNG of its name, its plan.

    source: map file or file of polygons. goal_m, start_m: points in
    the cells of goal and start, by default far apart. replace: also a file that was edited.
    SerdError or FileError where the map is wrong or no task fits into it.
    """
    raster = None if is_area_file(source) else read_map(source)
    area = read_area_m(source, start_m) if raster is None else free_area_m(raster, start_m)
    text = map_scenario_yaml(
        area,
        settings,
        name=source.stem,
        source=f"Place of the {'area' if raster is None else 'map'} {source.name}",
        goal_m=goal_m,
        start_m=start_m,
    )
    scenario = yaml_model(text, Scenario, name=str(file))
    if not replace:
        _require_unedited(file, text)
    atomic_write_text(file, text)
    picture = file.with_suffix(".png")
    from serd_app.report.maps import save_plan

    save_plan(picture, scenario)
    return MappedScenario(scenario, area, raster, file, picture)


def _require_unedited(path: Path, text: str) -> None:
    """AppError where the file exists and differs from what would be written."""
    if path.exists() and read_text(path) != text:
        raise AppError(
            f"{path} must not be replaced without --output, got other content than would be"
            f" written; name another file, or give --output {path} to replace it"
        )
