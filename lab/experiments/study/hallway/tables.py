"""All tables of the study that are not of a figure, and its main numbers."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import pandas as pd

from lab.experiments.running.statistics import mean_interval, paired_family
from lab.experiments.running.tables import Row, quantile
from lab.experiments.study.arrival.distances import ArrivalTables, distance_row
from lab.experiments.study.arrival.stage import STEP_S, measured_cdf, n_episodes, n_steps
from lab.experiments.study.fits.methods import BASELINE, OURS
from lab.experiments.study.products import load_part
from lab.experiments.study.recordings.demonstrations import ROLES, load_sets
from lab.experiments.study.recordings.experts import BELIEFS, EXPERTS, PEOPLE
from lab.experiments.study.recordings.reference import reference_table
from lab.experiments.study.study import Study
from serd_app.report.summary import decisions_per_model
from serd_core.arrays import FloatArray
from serd_core.arrival.arriving_policy import trap_states


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


#: Scores of a method, (R,) each; the worlds of a repetition are the same for all methods.
_SCORES: dict[str, Callable[[ArrivalTables], FloatArray]] = {
    "crps_s": lambda tables: tables.scores,
    "measured_mean_s": lambda tables: tables.measured_means_s,
}
MEASURES = ("test_log_likelihood", "transfer_log_likelihood", "dynamics_divergence")


def all_tables(results: Results) -> dict[str, pd.DataFrame]:
    """Every table by the name of its file."""
    return {
        "measures": results.measures,
        "prior_weights": prior_weights(results),
        "paired_tests": paired_tests(results, PEOPLE, OURS),
        "beliefs": beliefs(results),
        "arrival_distances": arrival_distances(results),
        "arrival_scores": arrival_scores(results),
        "measured_episodes": results.measured,
        "traps": traps(results),
        "reference_dynamics": reference_table(results),
        "demonstrations": demonstrations_table(results),
    }


def headline(tables: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Medians at the largest number of demonstrations, and arrivals, of every method.

    test, transfer: log-likelihood per decision; KLD: of the dynamics from the reference; arrived,
    predicted: measured and predicted share; mean_s, predicted_s: mean times, cut off at the limit.
    """
    learned, arrivals = tables["measures"], tables["arrival_distances"]
    learned = learned[learned["expert"] == PEOPLE]
    learned = learned[learned["size"] == learned["size"].max()]
    medians = learned.groupby("method")[list(MEASURES)].agg(lambda values: quantile(values, 0.5))
    columns = dict(zip(MEASURES, ("test", "transfer", "KLD"), strict=True)) | {
        "measured_arrival": "arrived",
        "predicted_arrival": "predicted",
        "measured_mean_s": "mean_s",
        "predicted_mean_s": "predicted_s",
        "ks": "KS",
    }
    both = arrivals[arrivals["expert"] == PEOPLE].merge(medians, on="method")
    return both[["method", *columns]].rename(columns=columns)


def prior_weights(results: Results) -> pd.DataFrame:
    """Fig. 5.8: medians over repetitions for every size and lambda of the divergence prior."""
    groups = results.candidates.groupby(["size", "prior_weight"])
    names = ["validation_log_likelihood", *MEASURES]
    medians = groups[names].agg(lambda values: quantile(values, 0.5))
    medians.insert(0, "n", groups.size())
    return medians.reset_index()


def paired_tests(results: Results, expert: str, against: str) -> pd.DataFrame:
    """Mean difference of every other method to one, within repetitions; p-values by Holm.

    One family of tests: all other methods at one size, for one measure.
    """
    rng = np.random.default_rng([results.settings.seed, 1])
    table: list[Row] = []
    for measure, size, values in _measured(results, expert):
        place: Row = {"expert": expert, "measure": measure, "size": size, "first": against}
        family = paired_family(values, against, results.settings.statistics, rng)
        table += [place | row for row in family]
    return pd.DataFrame(table)


def beliefs(results: Results) -> pd.DataFrame:
    """Each assumption about the belief: mean of every measure, and its difference to IRL."""
    rng = np.random.default_rng([results.settings.seed, 2])
    means: list[Row] = []
    for expert in BELIEFS:
        for measure, size, values in _measured(results, expert):
            place: Row = {"expert": expert, "measure": measure, "size": size}
            for assumption, column in values.items():
                mean = mean_interval(column, results.settings.statistics, rng)
                row = {"assumption": assumption, "n": len(column)}
                means.append(place | row | mean.columns("mean"))
    tests = pd.concat([paired_tests(results, expert, BASELINE) for expert in BELIEFS])
    both = pd.DataFrame(means).merge(
        tests.rename(columns={"second": "assumption"}),
        how="left",
        on=["expert", "measure", "size", "assumption"],
        suffixes=("", "_of_test"),
    )
    is_other = both["assumption"] != BASELINE
    # The tests are of the baseline minus the assumption.
    for name, tested in (
        ("difference", "mean_difference"),
        ("difference_lower", "upper_of_test"),
        ("difference_upper", "lower_of_test"),
    ):
        both[name] = (-both[tested]).where(is_other, 0.0)
    place_columns = ["expert", "assumption", "measure", "size", "n", "mean", "lower", "upper"]
    return both[[*place_columns, "difference", "difference_lower", "difference_upper", "p_holm"]]


def arrival_distances(results: Results) -> pd.DataFrame:
    """Distances of predicted from measured times of arrival, for every expert and method."""
    rng = np.random.default_rng([results.settings.seed, 3])
    table: list[Row] = []
    for expert in EXPERTS:
        for method in results.methods(expert):
            tables = results.arrival_tables(expert, method)
            table.append(
                {
                    "expert": expert,
                    "method": method,
                    **distance_row(tables, results.settings.statistics, rng),
                }
            )
    return pd.DataFrame(table)


def arrival_scores(results: Results) -> pd.DataFrame:
    """Differences of scores between methods, within repetitions.

    One family of tests: all other methods, for one measure.
    """
    rng = np.random.default_rng([results.settings.seed, 4])
    table: list[Row] = []
    for expert in EXPERTS:
        first = OURS if expert == PEOPLE else BASELINE
        tables = {name: results.arrival_tables(expert, name) for name in results.methods(expert)}
        for measure, values_of in _SCORES.items():
            values = pd.DataFrame({name: values_of(each) for name, each in tables.items()})
            place: Row = {"expert": expert, "measure": measure, "first": first}
            family = paired_family(values, first, results.settings.statistics, rng)
            table += [place | row for row in family]
    return pd.DataFrame(table)


def traps(results: Results) -> pd.DataFrame:
    """Number of trap states of the greedy policies of each method.

    start_traps: share of the repetitions in which a start cell of the training task is one.
    """
    problem = results.problem
    table: list[Row] = []
    for method in results.methods(PEOPLE):
        masks = np.array(
            [
                trap_states(problem.grid.neighbours, greedy, problem.goal_states)
                for greedy in results.models(PEOPLE, method, "greedy")
            ]
        )
        counts = masks.sum(axis=1)
        table.append(
            {
                "method": method,
                "n": len(counts),
                "states": problem.grid.n_states,
                "median_traps": float(np.median(counts)),
                "fewest_traps": int(counts.min()),
                "most_traps": int(counts.max()),
                "without_traps": float((counts == 0).mean()),
                "start_traps": float(masks[:, results.starts > 0].any(axis=1).mean()),
            }
        )
    return pd.DataFrame(table)


def demonstrations_table(results: Results) -> pd.DataFrame:
    """One row per expert and set, over all repetitions; shares of decisions by outcome model."""
    table: list[Row] = []
    for expert in EXPERTS:
        every = [
            load_sets(results, expert, number)
            for number in range(results.settings.n_repetitions(expert))
        ]
        for role in ROLES:
            sets = [getattr(each, role) for each in every]
            n_decisions = sum(len(each) for each in sets)
            n_episodes = sum(len(each.episodes) for each in sets)
            counts = np.sum([decisions_per_model(results.problem, each) for each in sets], axis=0)
            table.append(
                {
                    "expert": expert,
                    "set": role,
                    "repetitions": len(sets),
                    "episodes": n_episodes,
                    "decisions": n_decisions,
                    "mean_s": sum(each.dwell_s.sum() for each in sets) / n_episodes,
                }
                | dict(zip(results.problem.model_names, counts / n_decisions, strict=True))
            )
    return pd.DataFrame(table)


def _measured(results: Results, expert: str) -> Iterator[tuple[str, int, pd.DataFrame]]:
    """Each measure and size with its values: a row per repetition, a column per method."""
    table = results.measures[results.measures["expert"] == expert]
    for measure in MEASURES:
        for size, chosen in table.groupby("size"):
            values = chosen.pivot(index="repetition", columns="method", values=measure)
            yield measure, int(size), values[results.methods(expert)]
