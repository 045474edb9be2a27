"""Tables of numbers that are no figure: all measures, paired tests, beliefs, traps; arrivals'."""

import numpy as np

from experiments.running.repetitions import Row
from experiments.study.arrival.hindsight import hindsight_table
from experiments.study.fits.methods import BASELINE, OURS
from experiments.study.recordings.experts import EXPERTS, PEOPLE
from experiments.study.tables.arrival import arrival_distances, arrival_scores
from experiments.study.tables.paired_statistics import mean_interval, paired_family
from experiments.study.tables.recordings import demonstrations_table, reference_table
from experiments.study.tables.results import Results
from experiments.study.world import TRAIN_AREA
from serd_core.arrival.trap_states import trap_states
from sim.scenario.grid import start_states_of

MEASURES = ("test_log_likelihood", "transfer_log_likelihood", "dynamics_divergence")


def all_tables(results: Results) -> dict[str, list[Row]]:
    """Every table by the name of its file."""
    return {
        "measures": results.measures,
        "paired_tests": paired_tests(results, PEOPLE, OURS),
        "beliefs": beliefs(results),
        "arrival_distances": arrival_distances(results),
        "arrival_scores": arrival_scores(results),
        "arrival_hindsight": hindsight_table(results),
        "measured_episodes": results.measured,
        "traps": traps(results),
        "reference_dynamics": reference_table(results),
        "demonstrations": demonstrations_table(results),
    }


def values_of(results: Results, expert: str, method: str, size: int, measure: str) -> list[float]:
    """One measure of each repetition, in their order."""
    rows = [
        row
        for row in results.measures
        if (row["expert"], row["method"], row["size"]) == (expert, method, size)
    ]
    return [row[measure] for row in sorted(rows, key=lambda row: int(row["repetition"]))]


def paired_tests(results: Results, expert: str, against: str) -> list[Row]:
    """Mean difference of every other method to one, within repetitions; p-values by Holm.

    One family of tests: all other methods at one size, for one measure.
    """
    rng = np.random.default_rng([results.settings.seed, 1])
    table: list[Row] = []
    for measure in MEASURES:
        for size in _sizes(results, expert):
            values = {
                method: values_of(results, expert, method, size, measure)
                for method in results.methods(expert)
            }
            ours = values.pop(against)
            place: Row = {"expert": expert, "measure": measure, "size": size, "first": against}
            family = paired_family(ours, values, results.settings.statistics, rng)
            table += [place | row for row in family]
    return table


def beliefs(results: Results) -> list[Row]:
    """Which assumption about the belief pays when: means, and differences to IRL."""
    rng = np.random.default_rng([results.settings.seed, 2])
    table: list[Row] = []
    for expert in EXPERTS:
        if expert == PEOPLE:
            continue
        tests = {
            (row["measure"], row["size"], row["second"]): row
            for row in paired_tests(results, expert, BASELINE)
        }
        for measure in MEASURES:
            for size in _sizes(results, expert):
                for method in results.methods(expert):
                    values = values_of(results, expert, method, size, measure)
                    mean = mean_interval(values, results.settings.statistics, rng)
                    test = tests.get((measure, size, method))
                    table.append(
                        {
                            "expert": expert,
                            "assumption": method,
                            "measure": measure,
                            "size": size,
                            "n": len(values),
                            "mean": mean.value,
                            "lower": mean.lower,
                            "upper": mean.upper,
                            # The test is of the baseline minus this one; told the other way round.
                            "difference": -test["mean_difference"] if test else 0.0,
                            "difference_lower": -test["upper"] if test else 0.0,
                            "difference_upper": -test["lower"] if test else 0.0,
                            "p_holm": test["p_holm"] if test else None,
                        }
                    )
    return table


def traps(results: Results) -> list[Row]:
    """How many states the greedy policies of each method never leave for the goal.

    start_traps: share of the repetitions in which a start cell of the training task is one.
    """
    problem = results.problem
    starts = start_states_of(results.scenario, problem.grid, TRAIN_AREA)
    table: list[Row] = []
    for method in results.methods(PEOPLE):
        masks = np.array(
            [
                trap_states(
                    problem.grid.neighbours,
                    np.array(results.model(PEOPLE, number, method)["greedy"]),
                    problem.goal_states,
                )
                for number in range(results.settings.learning.repetitions)
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
                "start_traps": float(masks[:, starts].any(axis=1).mean()),
            }
        )
    return table


def _sizes(results: Results, expert: str) -> list[int]:
    return sorted({row["size"] for row in results.measures if row["expert"] == expert})
