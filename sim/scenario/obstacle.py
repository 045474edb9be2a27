"""Obstacles: solids of the place, such as pillars and shelves."""

from sim.scenario.settings import Outline
from storage.settings import setting
from storage.yaml_config import StrictModel


class Obstacle(StrictModel):
    """A solid inside the walkable area."""

    name: str = setting(..., "name of the obstacle")
    outline_m: Outline = setting(..., "corners of a simple polygon, in order", unit="m")
