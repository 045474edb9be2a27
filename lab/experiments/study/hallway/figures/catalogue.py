"""All figures of the study by the number the thesis gives them."""

from collections.abc import Callable
from dataclasses import dataclass
from types import ModuleType

import pandas as pd
from matplotlib.figure import Figure

from lab.experiments.study.hallway.figures import (
    arrival,
    beliefs,
    features,
    measures,
    policies,
    prior_weights,
    scenario,
    visitation,
)
from lab.experiments.study.hallway.tables.results import Results
from lab.experiments.study.study import Study
from serd_bag.nearest import choice_rule
from serd_core.errors import SerdError


@dataclass(frozen=True)
class StudyFigure:
    """name: as on the command line; rows: its table; draw: the picture of that table."""

    name: str
    shows: str
    rows: Callable[[Results], pd.DataFrame]
    draw: Callable[[pd.DataFrame, Study], Figure]

    @property
    def stem(self) -> str:
        """Name of its files."""
        return f"figure_{self.name.replace('.', '_')}"


def _figure(name: str, shows: str, module: ModuleType) -> StudyFigure:
    return StudyFigure(name, shows, module.rows, module.draw)


FIGURES = (
    _figure("5.5", "features of the reward", features),
    _figure("5.6", "the scenario", scenario),
    _figure("5.7", "where the demonstrations went", visitation),
    _figure("5.8", "weight of the divergence prior", prior_weights),
    _figure("5.9", "learners over the number of demonstrations", measures),
    _figure("5.10", "predicted and measured time of arrival", arrival),
    _figure("5.11", "policies and their trap states", policies),
    _figure("beliefs", "experts who know and experts who err", beliefs),
)


def figure_of(name: str) -> StudyFigure:
    """The figure of that name; SerdError with the nearest name otherwise."""
    for figure in FIGURES:
        if figure.name == name:
            return figure
    names = [figure.name for figure in FIGURES]
    raise SerdError(choice_rule("figure", name, names))
