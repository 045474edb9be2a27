"""Headlines beside drives: what SERD claims of each recording, and what the stand-in then does."""

import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lab.truth.recordings import KINDS, Kind, place_of, write_recording
from lab.truth.stand_in import Rover
from serd_app.demonstrations.suggest import suggest_mapping
from serd_app.journeys.demonstrate import PlaceChoice, demonstrate
from serd_app.journeys.learn import learn_from_table
from serd_app.journeys.report import ReportSources, inputs_of_model
from serd_app.learning.criticism import outside_band
from serd_app.learning.settings import LearningSettings
from serd_app.report.summary import headline_of, summary_of
from serd_bag.files import atomic_write_text
from serd_core.arrays import FloatArray, IntArray
from serd_core.arrival.law import ArrivalLaw, binomial_tail
from serd_core.grid.grid import Action
from serd_files.errors import USER_ERRORS
from serd_files.model_file import Check
from serd_sim.drivers.strategy import Strategy

N_ROLLOUTS = 12
#: A headline is contradicted where what was measured has a lower probability than this.
_LEVEL = 0.02
_BAND = 0.1


@dataclass(frozen=True)
class Verdict:
    """headline: the largest sentence of the page; claims: whether it states an arrival.

    times_s: of arrival of the rollouts, inf for none; disagrees: why they contradict the headline.
    """

    name: str
    headline: str
    claims: bool
    checks: tuple[Check, ...] = ()
    times_s: tuple[float, ...] = ()
    disagrees: str = ""

    def lines(self) -> Iterator[str]:
        """The headline, each check, and the rollouts."""
        yield f"{self.name}: {self.headline}"
        yield from (f"    {each.mark:7} {each.key}: {each.sentence}" for each in self.checks)
        arrived = np.isfinite(self.times_s)
        if len(self.times_s):
            half = f", half after {np.median(self.times_s):.1f} s" if arrived.all() else ""
            yield f"    rollouts in the stand-in: {arrived.sum()} of {len(arrived)} arrive{half}"
        if self.disagrees:
            yield f"    DISAGREES: {self.disagrees}"


def judge(name: str, folder: Path, seed: int = 0) -> Verdict:
    """Record a kind, learn from it as a stranger would, drive, and compare."""
    kind = KINDS[name]
    bag = write_recording(kind, folder / name, zlib.crc32(name.encode()) + seed)
    return verdict_of(name, bag, folder, kind, seed)


def verdict_of(name: str, bag: Path, folder: Path, kind: Kind | None, seed: int = 0) -> Verdict:
    """The same of a bag; without a kind nothing drives."""
    mapping, table = folder / f"{name}.map.yaml", folder / f"{name}.csv"
    try:
        atomic_write_text(mapping, suggest_mapping(bag).yaml(mapping))
        demonstrate([bag], table, PlaceChoice(), mapping=mapping)
        learned = learn_from_table(table, folder / f"{name}.model.yaml", LearningSettings())
        inputs = inputs_of_model(ReportSources(learned.model, demonstrations=table))
    except USER_ERRORS as error:
        return Verdict(name, f"refused: {error}", claims=False)
    summary = summary_of(inputs)
    claims = not summary["no_prediction_because"]
    decisions = learned.files.decisions
    starts = decisions.state[np.unique(decisions.episode, return_index=True)[1]]
    times_s: FloatArray = np.zeros(0)
    if kind is not None:
        rng = np.random.default_rng(seed + 1)
        times_s = np.array(
            [
                rollout(inputs.strategy, int(rng.choice(starts)), kind, rng)
                for _ in range(N_ROLLOUTS)
            ]
        )
    disagrees = contradiction(inputs.strategy, starts, times_s) if claims and len(times_s) else ""
    checks = learned.outcome.model.checks
    return Verdict(name, headline_of(summary), claims, checks, tuple(times_s.tolist()), disagrees)


def rollout(strategy: Strategy, start: int, kind: Kind, rng: np.random.Generator) -> float:
    """Time of arrival (s) of the stand-in by the learned policy from a cell, inf for none."""
    grid, policy = strategy.problem.grid, strategy.policy
    rover: Rover = place_of(kind, rng)
    begin = grid.centers_m[start]
    rover.pose = rover.odometry = np.array([*begin, rng.uniform(-np.pi, np.pi)])
    goals, state = set(strategy.problem.goal_states.tolist()), start
    while rover.time_s < strategy.timeout_s and state not in goals:
        action = int(rng.choice(len(policy.probabilities[state]), p=policy.probabilities[state]))
        waits = action == Action.WAIT
        place = grid.centers_m[grid.neighbours[state, action]]
        until_s = rover.time_s + (strategy.file.wait_s if waits else strategy.file.patience_s)
        while rover.time_s < until_s:
            if waits or rover.steer_at(place, kind.fastest_mps):
                rover.command = (0.0, 0.0)
            rover.step()
            now = int(grid.states_at(rover.odometry[None, :2])[0])
            if not waits and now >= 0 and now != state:
                break
        state = now if now >= 0 else state
    return rover.time_s if state in goals else float("inf")


def contradiction(strategy: Strategy, starts: IntArray, times_s: FloatArray) -> str:
    """Why measured times contradict the forecast from the recorded starts, empty where not."""
    share = np.bincount(starts, minlength=strategy.problem.grid.n_states) / len(starts)
    law: ArrivalLaw = strategy.law_from(share)
    n, arrived = len(times_s), int(np.isfinite(times_s).sum())
    claimed = float(law.cdf[-1])
    fewer = binomial_tail(n - arrived, n, 1.0 - claimed)
    if fewer < _LEVEL:
        return f"{arrived} of {n} arrive, where {claimed:.0%} are claimed"
    outside = int(outside_band(law, times_s).sum())
    if binomial_tail(outside, n, _BAND) < _LEVEL:
        low, high = (law.quantile_s(each) for each in (0.05, 0.95))
        return f"{outside} of {n} are outside the band of {low} to {high} s"
    return ""
