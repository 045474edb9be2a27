"""Everything a report is made of: one frozen record, checked for agreement of its parts."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

from serd_app.learning.criticism import RecordedTimes
from serd_app.learning.knowledge import DynamicsRow, Knowledge
from serd_app.navigation.comparison import arrival_times_s, predicted_law
from serd_core.arrays import FloatArray
from serd_core.arrival.law import ArrivalLaw
from serd_core.demonstrations.decisions import Decisions
from serd_core.learners.fit_result import FitResult
from serd_files.table import EpisodeResult
from serd_sim.drivers.strategy import Strategy


@dataclass(frozen=True)
class PhaseTiming:
    """Wall-clock time of one phase, and the simulated time it covered if it simulated anything."""

    name: str
    wall_s: float
    simulated_s: float | None = None


@dataclass(frozen=True)
class FileLink:
    """A file or folder beside the report; `path` is relative to the report's folder."""

    path: str
    what: str


@dataclass(frozen=True)
class RunFacts:
    """What a reader needs to make the same run again; `finished_at` is ISO 8601."""

    command: str
    how: str
    finished_at: str
    phases: tuple[PhaseTiming, ...] = ()
    seeds: Mapping[str, int] = field(default_factory=dict)
    versions: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Forecast:
    """The computed arrival from a place; name: of a start area, or the point.

    trapped: whether the learned policy does not arrive from a cell of it.
    """

    name: str
    law: ArrivalLaw
    trapped: bool = False


@dataclass(frozen=True, eq=False, kw_only=True)
class ReportInputs:
    """A learned model: demonstrations, what was learned from them, and how it then drove.

    demonstrations: may be empty, then n_demonstrations is how many there were.
    demonstration_tracks_m: (T, 2) recorded x, y of each demonstration, may be empty.
    episodes: empty where it has not driven. knowledge: None where the fit has no posterior.
    forecasts: from chosen starts. both: counted dynamics and those learned with rewards.
    recorded: times of arrival of the demonstrations, None where they are not known.
    """

    title: str
    strategy: Strategy
    demonstrations: Decisions
    demonstration_tracks_m: tuple[FloatArray, ...] = ()
    fit: FitResult
    episodes: tuple[EpisodeResult, ...]
    run: RunFacts
    files: tuple[FileLink, ...] = ()
    knowledge: Knowledge | None = None
    both: tuple[DynamicsRow, ...] = ()
    forecasts: tuple[Forecast, ...] = ()
    n_demonstrations: int = 0
    recorded: RecordedTimes | None = None

    @cached_property
    def predicted(self) -> ArrivalLaw:
        """The arrival of the policy from the area `train`, up to the time-out."""
        return predicted_law(self.strategy, "train")

    @property
    def arrival_times_s(self) -> FloatArray:
        """(N,) time of arrival of each episode, inf where it did not arrive."""
        return arrival_times_s(self.episodes)


def in_words(name: str) -> str:
    """A code name for people: `with_flow` becomes `with flow`."""
    return name.replace("_", " ")


def percent(share: float) -> str:
    """A share of one as a percentage without needless digits."""
    value = 100 * share
    return f"{value:.0f} %" if abs(value - round(value)) < 0.05 else f"{value:.1f} %"
