"""The people of a study: their decisions, and the forecasts asked for."""

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from lab.experiments.study.people.place import Place
from lab.experiments.study.people.recordings import Run, Walker, read_runs
from lab.experiments.study.people.settings import PeopleSettings
from serd_app.demonstrations.decision_table import concatenate
from serd_core.arrays import BoolArray, FloatArray, IntArray
from serd_core.demonstrations.decisions import TimedDecisions


@dataclass(frozen=True)
class Asked:
    """A forecast that is asked for: at time_s in a state, answered by duration_s until arrival."""

    walker: int
    state: int
    time_s: float
    duration_s: float


@dataclass(frozen=True, eq=False)
class People:
    """P walkers of all runs, numbered run by run."""

    runs: tuple[Run, ...]
    settings: PeopleSettings

    @classmethod
    def read(cls, settings: PeopleSettings) -> "People":
        """The people of the files that the settings name."""
        paths = [Path(each) for each in settings.files]
        return cls(read_runs(paths, settings.columns, settings), settings)

    @cached_property
    def place(self) -> Place:
        """All corridors."""
        settings = self.settings
        return Place(self.runs, settings.discount, settings.patience_s, settings.wait_s)

    @cached_property
    def walkers(self) -> tuple[Walker, ...]:
        """(P,) all of them."""
        return tuple(walker for run in self.runs for walker in run.walkers)

    @cached_property
    def run_of(self) -> IntArray:
        """(P,) run of each person."""
        return np.repeat(np.arange(len(self.runs)), [len(run.walkers) for run in self.runs])

    @cached_property
    def decisions(self) -> TimedDecisions:
        """All decisions in the states of the place, an episode per person."""
        first = np.searchsorted(self.run_of, np.arange(len(self.runs)))
        return concatenate(
            [
                replace(
                    run.decisions,
                    episode=run.decisions.episode + person,
                    state=run.decisions.state + state,
                    next_state=run.decisions.next_state + state,
                )
                for run, person, state in zip(self.runs, first, self.place.start[:-1], strict=True)
            ]
        )

    def decisions_of(self, mask: BoolArray) -> TimedDecisions:
        """The decisions of the people of a mask (P,)."""
        return self.decisions.select(mask[self.decisions.episode])

    def signs_of(self, decisions: TimedDecisions) -> IntArray:
        """(N,) sign of the walker of each decision."""
        return np.array([walker.sign for walker in self.walkers])[decisions.episode]

    @cached_property
    def asked(self) -> tuple[Asked, ...]:
        """(P,) the forecast of each person, on entering the first cell after the observed ones."""
        every, observed = self.decisions, self.settings.grid.observed_cells
        column = np.concatenate([run.column for run in self.runs])[every.state]
        ends_s = every.time_s + every.dwell_s
        found = []
        for person in range(len(self.walkers)):
            own = np.flatnonzero(every.episode == person)
            here = own[np.argmax(column[own] >= observed)]
            time_s = float(every.time_s[here])
            duration_s = float(ends_s[own[-1]] - time_s)
            found.append(Asked(person, int(every.state[here]), time_s, duration_s))
        return tuple(found)

    @cached_property
    def seen(self) -> TimedDecisions:
        """The decisions of all people before their forecasts."""
        until_s = np.array([one.time_s for one in self.asked])
        return self.decisions.select(self.decisions.time_s < until_s[self.decisions.episode])

    def asked_of(self, mask: BoolArray) -> list[Asked]:
        """The forecasts of the people of a mask (P,)."""
        return [self.asked[i] for i in np.flatnonzero(mask)]

    @cached_property
    def times_s(self) -> FloatArray:
        """(T,) times of forecasts: steps up to some times the longest measured arrival."""
        forecast = self.settings.forecast
        last_s = forecast.horizon * max(one.duration_s for one in self.asked)
        steps = np.arange(int(np.ceil(last_s / forecast.step_s)) + 1)
        return np.asarray(forecast.step_s * steps, dtype=np.float64)


def evenly(mask: BoolArray, most: int) -> BoolArray:
    """A mask of at most so many of the people of a mask."""
    people = np.flatnonzero(mask)
    chosen = np.linspace(0, len(people) - 1, min(most, len(people))).round().astype(np.int64)
    found = np.zeros_like(mask)
    found[people[chosen]] = True
    return found
