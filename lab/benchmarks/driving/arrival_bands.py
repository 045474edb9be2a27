"""How often 90 % bands of the time of arrival hold it in places that were not learned from.

    python -m lab arrival-bands

Models are learned in the hallway by the default method, from disjoint groups of the same recorded
demonstrations, and drive in other places. Episodes are kept in lab/results/arrival_bands.jsonl, so
an interrupted run goes on where it stopped. Models are kept under .cache: delete that folder after
a change of learning, and the episodes too where policies or the simulator changed.
"""

import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass, fields
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from lab.benchmarks.driving.closed_loop import ROOT
from lab.benchmarks.report import measured_rows, save
from lab.experiments.study.recordings.drives import drive_in
from serd_app.demonstrations.demonstrations import Demonstrations
from serd_app.learning.outcome import save_outcome
from serd_app.learning.recipe import learn, task_in
from serd_app.learning.settings import LearningSettings
from serd_app.navigation.drive import DriveSettings
from serd_app.navigation.navigator import Navigator
from serd_app.navigation.strategy import Strategy, start_distribution
from serd_core.arrays import FloatArray
from serd_core.arrival.bands import clopper_pearson
from serd_core.arrival.chain import ArrivalTimes
from serd_core.arrival.law import SAME_TIME_S, ArrivalLaw, entry_times_s, steps_within
from serd_sim.drivers.catalogue import make_driver
from serd_sim.episodes.episode import EpisodeRecord, run_episode
from serd_sim.planning.catalogue import make_planner
from serd_sim.scenario.grid import grid_of
from serd_sim.scenario.scenario import load_scenario
from serd_sim.world.world import HallwayWorld

LEARNED_IN, LEARNING_SEED, N_DEMONSTRATIONS = "hallway", 3, 40
SIZES = (20, 5, 2)
DRIVING_SEED, N_EPISODES = 1000, 21
_MODELS = ROOT / ".cache" / "benchmarks" / "arrival_bands"


@dataclass(frozen=True)
class Place:
    """A scenario, the number of people there (its own when None) and the start area."""

    scenario: str
    people: int | None = None
    start: str = "train"


PLACE = [field.name for field in fields(Place)]
PLACES = (
    Place("hallway"),
    Place("hallway", start="transfer"),
    Place("hallway", people=60),
    Place("corridor"),
    Place("crossing"),
    Place("t_junction"),
    Place("ring"),
)


def run() -> None:
    """Drive the episodes that are missing, then write the table."""
    rows = measured_rows("arrival_bands", cases(), episode)
    scores = [score(row, size) for size in SIZES for row in rows]
    by = ["demonstrations", *PLACE]
    save(
        "arrival_bands",
        f"90 % bands of arrival by models of the {LEARNED_IN}, in other places",
        [
            dict(zip(by, key, strict=True)) | summary(group)
            for key, group in pd.DataFrame(scores).groupby(by, sort=False)
        ],
    )


def cases() -> Iterator[dict[str, Any]]:
    """One per episode and place, in an order in which any end leaves equal numbers."""
    for number in range(N_EPISODES):
        for place in PLACES:
            yield {**asdict(place), "episode": number}


def episode(scenario: str, people: int | None, start: str, episode: int) -> dict[str, Any]:
    """drives: the time of arrival (s, None without) and the cell at each decision, by size.

    Each size has the model of one group in turn. A drive counts for every model that would have
    decided the same in each of its cells.
    """
    place, found = Place(scenario, people, start), {}
    drives: list[EpisodeRecord] = []
    for size in SIZES:
        navigator = navigator_of(place, size, group_of(size, episode))
        greedy = navigator.strategy.policy.greedy
        agreeing = (
            each for each in drives if np.all(greedy[each.decisions.state] == each.decisions.action)
        )
        drive = next(agreeing, None)
        if drive is None:
            drive = _drive(navigator, place, episode)
            drives.append(drive)
        arrived = drive.outcome == "arrived"
        found[str(size)] = {
            "time_s": round(drive.time_of_arrival_s, 3) if arrived else None,
            "states": drive.decisions.state.tolist(),
        }
    return {"drives": found}


def group_of(size: int, episode: int) -> int:
    """The group of demonstrations of the model that drives an episode."""
    return episode % (N_DEMONSTRATIONS // size)


def _drive(navigator: Navigator, place: Place, episode: int) -> EpisodeRecord:
    """As `serd navigate` drives; until it is given up."""

    def go_on(*_: object) -> bool:
        return not navigator.reason

    scenario = navigator.strategy.scenario
    with HallwayWorld(scenario, seed=DRIVING_SEED) as world:
        return run_episode(
            world,
            make_planner("dwa", scenario),
            navigator,
            episode=episode,
            start_area=place.start,
            timeout_s=navigator.strategy.timeout_s,
            observer=go_on,
            waypoint_of=navigator.waypoint_of,
        )


def navigator_of(place: Place, size: int, group: int) -> Navigator:
    """Of the model of a group of `size` demonstrations."""
    settings = DriveSettings(
        model=str(model_of(size, group)),
        scenario=place.scenario,
        people=place.people,
        start_area=place.start,
        seed=DRIVING_SEED,
        transfer=True,
    )
    return Navigator(settings.place(), settings)


def model_of(size: int, group: int) -> Path:
    """File of the model of a group of demonstrations, learned unless it is there."""
    path = _MODELS / f"{size}_{group}.yaml"
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        recorded = demonstrations()
        episodes = range(size * group, size * (group + 1))
        found = learn(
            task_in(load_scenario(LEARNED_IN), LearningSettings().discount),
            Demonstrations(
                recorded.decisions.select_episodes(episodes),
                recorded.goal_entry_s[episodes.start : episodes.stop],
            ),
            LearningSettings(),
        )
        save_outcome(path, found, grid_of(load_scenario(LEARNED_IN)))
    return path


@cache
def demonstrations() -> Demonstrations:
    """All recorded demonstrations, each of which arrives."""
    scenario = load_scenario(LEARNED_IN)
    task = task_in(scenario, LearningSettings().discount)
    drives = drive_in(
        scenario,
        task.problem,
        "dwa",
        make_driver("expert", scenario, LEARNING_SEED),
        seed=LEARNING_SEED,
        starts=[(number, "train") for number in range(N_DEMONSTRATIONS)],
        guard=None,
    )
    times_s = [record.time_of_arrival_s for record in drives.records]
    entry_s = entry_times_s(times_s, scenario.decision_period_s)
    return Demonstrations(drives.decisions, tuple(entry_s.tolist()))


def score(row: dict[str, Any], size: int) -> dict[str, Any]:
    """The band of one drive, and whether it held the time of arrival.

    late_s: by how much it arrived after the band, below 0 before it. periods_held: whether it
    arrived in the periods of the band; periods_expected: their probability by the model, 90 % or
    more. of_decisions: share of bands of the remaining time, made at each decision, that held it.
    """
    place, drive = Place(*(row[name] for name in PLACE)), row["drives"][str(size)]
    strategy = strategy_of(place, size, group_of(size, row["episode"]))
    starts = start_distribution(strategy.scenario, place.start)
    time_s = math.inf if drive["time_s"] is None else drive["time_s"]
    elapsed_s = strategy.scenario.decision_period_s * np.arange(len(drive["states"]))
    laws = [_law(strategy, strategy.arrival.cdf[:, state]) for state in drive["states"]]
    held = [
        late(band_of(law), left_s) == 0.0
        for law, left_s in zip(laws, time_s - elapsed_s, strict=True)
    ]
    law = _law(strategy, strategy.arrival.cdf @ starts)
    low_s, high_s = band_of(law)
    period_s = strategy.scenario.decision_period_s
    begin_s, end_s = period_s * (steps_within(low_s, period_s) - 1), high_s
    if math.isfinite(high_s):
        end_s = period_s * steps_within(high_s, period_s)
    return {
        "demonstrations": size,
        **asdict(place),
        "people": strategy.scenario.pedestrians.count,
        "time_s": time_s,
        "median_s": law.quantile_s(0.5),
        "width_s": high_s - low_s,
        "periods_held": late((begin_s, end_s), time_s) == 0.0,
        "periods_expected": float(np.diff(law.probability_by([begin_s, end_s]))[0]),
        "late_s": late((low_s, high_s), time_s),
        "of_decisions": float(np.mean(held)),
    }


def _law(strategy: Strategy, cdf: FloatArray) -> ArrivalLaw:
    """In seconds, of an arrival counted in periods."""
    return strategy.law_s(ArrivalTimes(np.arange(len(cdf)), cdf, float(cdf[-1])))


def band_of(law: ArrivalLaw) -> tuple[float, float]:
    """From the 5 % to the 95 % quantile (s), as `serd navigate` prints it."""
    low_s, high_s = law.quantile_s(0.05), law.quantile_s(0.95)
    return (math.inf if low_s is None else low_s), (math.inf if high_s is None else high_s)


def late(band_s: tuple[float, float], time_s: float) -> float:
    """Seconds from a band to a time, below 0 before it, 0 within."""
    low_s, high_s = band_s
    if low_s - SAME_TIME_S <= time_s <= high_s + SAME_TIME_S:
        return 0.0
    return time_s - (low_s if time_s < low_s else high_s)


def summary(scores: pd.DataFrame) -> dict[str, Any]:
    """Of the drives in one place by models of one size."""
    held = scores["late_s"] == 0.0
    low, high = clopper_pearson([held.sum()], len(held))
    return {
        "episodes": len(held),
        "held": float(held.mean()),
        "lower": float(low[0]),
        "upper": float(high[0]),
        "periods_held": float(scores["periods_held"].mean()),
        "periods_expected": float(scores["periods_expected"].mean()),
        "early": int((scores["late_s"] < 0).sum()),
        "late": int((scores["late_s"] > 0).sum()),
        "width_s": float(scores["width_s"].mean()),
        "predicted_s": float(scores["median_s"].mean()),
        "measured_s": float(scores["time_s"].median()),
        "of_decisions": float(scores["of_decisions"].mean()),
    }


@cache
def strategy_of(place: Place, size: int, group: int) -> Strategy:
    """Plan and predictions of the model of a group."""
    return navigator_of(place, size, group).strategy
