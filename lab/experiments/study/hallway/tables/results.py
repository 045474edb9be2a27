"""Results of all stages as tables over all repetitions."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import pandas as pd

from lab.experiments.running.tables import Row
from lab.experiments.study.arrival.distances import ArrivalTables
from lab.experiments.study.arrival.stage import STEP_S, measured_cdf, n_episodes, n_steps
from lab.experiments.study.products import load_part
from lab.experiments.study.recordings.experts import EXPERTS
from lab.experiments.study.study import Study


@dataclass(frozen=True)
class Results(Study):
    """The finished stages of a study."""

    @cached_property
    def measures(self) -> pd.DataFrame:
        """Fig. 5.9's rows: expert, repetition, size, method."""
        return pd.DataFrame([row for fits in self._fits.values() for row in fits["measures"]])

    @cached_property
    def candidates(self) -> pd.DataFrame:
        """Fig. 5.8's rows: repetition, size, lambda."""
        return pd.DataFrame([row for fits in self._fits.values() for row in fits["candidates"]])

    @cached_property
    def measured(self) -> pd.DataFrame:
        """One row per measured episode."""
        return pd.DataFrame([row for found in self._arrivals.values() for row in found["measured"]])

    def methods(self, expert: str) -> list[str]:
        """Names of what was compared on an expert, in their order."""
        return list(self._fits[expert, 0]["models"])

    def predictions(self, expert: str, method: str) -> list[Row]:
        """The prediction of each repetition's model."""
        return [each["predicted"][method] for each in self._of(self._arrivals, expert)]

    def models(self, expert: str, method: str, name: str) -> np.ndarray:
        """(R, ...) one part of the model of each repetition: greedy or truth."""
        return np.array([each["models"][method][name] for each in self._of(self._fits, expert)])

    def arrival_tables(self, expert: str, method: str) -> ArrivalTables:
        """Predicted and measured CDFs of each repetition's model."""
        steps = n_steps(self.scenario)
        rows = self.measured[(self.measured[["expert", "method"]] == [expert, method]).all(axis=1)]
        measured = [measured_cdf(driven, steps) for _, driven in rows.groupby("repetition")]
        return ArrivalTables(
            predicted=np.array([each["cdf"] for each in self.predictions(expert, method)]),
            measured=np.array(measured),
            n_episodes=n_episodes(self.settings, expert),
            step_s=STEP_S,
        )

    @cached_property
    def _fits(self) -> dict[tuple[str, int], dict[str, Any]]:
        return {key: load_part(self, "fits", *key) for key in self.settings.repetitions_of(EXPERTS)}

    @cached_property
    def _arrivals(self) -> dict[tuple[str, int], dict[str, Any]]:
        keys = self.settings.repetitions_of(EXPERTS)
        return {key: load_part(self, "arrival", *key) for key in keys}

    @staticmethod
    def _of(stage: dict[tuple[str, int], dict[str, Any]], expert: str) -> list[dict[str, Any]]:
        """What a stage made of each repetition of an expert."""
        return [content for (name, _), content in stage.items() if name == expert]
