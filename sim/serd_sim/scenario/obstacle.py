"""Obstacles: solids of the place, such as pillars and shelves."""

from serd_files.settings import setting
from serd_files.yaml_config import StrictModel
from serd_sim.scenario.settings import Outline


class Obstacle(StrictModel):
    """A solid inside the walkable area."""

    name: str = setting(..., "name of the obstacle")
    outline_m: Outline = setting(..., "corners of a simple polygon, in order", unit="m")
