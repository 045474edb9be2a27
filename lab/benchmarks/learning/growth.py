"""One gradient from 10^2 to 10^7 states on the same landscape: time, exponent, memory, bandwidth.

Each size runs in a process of its own, whose peak memory is that of a cold gradient of that size.
Measured is the gradient of the log posterior by 2 weights and 45 outcome parameters: cold (the
Bellman equation from nothing) and, up to MOST_WARM states, warm (from the values of weights that
are one per cent smaller, as in a step of a fit). Demonstrations are those of a random policy.

One sweep of soft value iteration must at least read each entry of P with its column (12 bytes),
read the rewards, write and read Q, and read and write V:
bytes per state = 12 * entries + 8 * (3 * actions + 2).
Divided by the measured time that is compared with the bandwidth of copying a large array. Times are
processor times, so that other work on the machine does not count, and for a cold gradient also the
time that passes, on two cores where it uses two threads.
"""

import cProfile
import json
import pstats
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from lab.benchmarks.learning.gridworld_problems import (
    DYNAMICS,
    WEIGHTS,
    landscape_problem,
    objective_of,
)
from lab.benchmarks.measurement import best_of, best_times, peak_memory_mb
from lab.benchmarks.report import RESULTS, Row, save
from serd_app.report.style import BLUE, MUTED, RED, new_figure, report_style, save_figure
from serd_core.bellman.bellman_solver import BellmanProblem, backup
from serd_core.demonstrations.simulation import sample_decisions
from serd_core.dynamics.transition_model import transitions_of
from serd_core.learners.start import starting_parameters
from serd_core.mdp.problem import rewards
from serd_core.posterior.parameters import Parameters
from serd_core.posterior.posterior import Posterior

SIDES = (10, 32, 100, 316, 1000, 3163)
#: States up to which a warm gradient and a profile are measured.
MOST_WARM = 1_000_000
DISCOUNT = 0.99
#: Sizes from which the exponent is fitted; below them Python's overhead shows.
LARGE = 10_000
COPIED_BYTES = 400_000_000
PROFILE_LINES = 8
PROFILED_S = 0.5


def run() -> None:
    """Measure every size, write the table, the figure and the reports."""
    measured = [_in_own_process(side) for side in SIDES]
    rows = [{key: row[key] for key in row if key != "profile"} for row in measured]
    details = {
        "exponent_cold": exponent(rows, "cold (ms)"),
        "exponent_warm": exponent(rows, "warm (ms)"),
        "exponent_from_states": LARGE,
        "copy_bandwidth_GB_per_s": copy_bandwidth(),
        "profile_of_a_cold_gradient": {str(row["states"]): row["profile"] for row in measured},
    }
    save("growth", "One gradient over the number of states", rows, details)
    save_figure(RESULTS / "growth.png", growth_figure(rows, details))


def exponent(rows: Sequence[Row], column: str) -> float:
    """Slope of log time over log states, by least squares from LARGE states on."""
    kept = [row for row in rows if row["states"] >= LARGE and row[column] is not None]
    states, times = (np.log([row[name] for row in kept]) for name in ("states", column))
    return float(np.polyfit(states, times, 1)[0])


def copy_bandwidth() -> float:
    """GB/s of reading one large array and writing another, the best of ten."""
    source = np.ones(COPIED_BYTES // 8)
    target = np.zeros_like(source)
    seconds, _ = best_of(lambda: np.copyto(target, source), calls=10)
    return 2 * COPIED_BYTES / seconds / 1e9


def growth_figure(rows: Sequence[Row], details: dict[str, Any]) -> Figure:
    """Time and memory over states, both axes logarithmic."""
    with report_style():
        figure = new_figure(9.0, 3.8)
        times, memory = figure.subplots(1, 2)
        states = [row["states"] for row in rows]
        for name, colour in (("cold", RED), ("warm", BLUE)):
            label = f"{name}: ∝ states$^{{{details[f'exponent_{name}']:.2f}}}$"
            shown = [(row["states"], row[f"{name} (ms)"]) for row in rows if row[f"{name} (ms)"]]
            times.loglog(*zip(*shown, strict=True), "o-", color=colour, label=label)
        times.set(xlabel="states", ylabel="one gradient (ms)")
        times.legend(title=f"fitted from {LARGE:,} states")
        memory.loglog(states, [row["peak memory (MB)"] for row in rows], "o-", color=BLUE)
        memory.axhline(8_000, color=MUTED, linestyle="--", linewidth=1)
        memory.annotate("8 GB", (states[0], 8_000), xytext=(0, 3), textcoords="offset points")
        memory.set(xlabel="states", ylabel="peak memory of the process (MB)", ylim=(100, 20_000))
        memory.yaxis.set_minor_formatter(NullFormatter())
    return figure


def measure(side: int) -> dict[str, Any]:
    """One size: times, memory, the sweep's bandwidth, and where a cold gradient spends its time."""
    base_mb = peak_memory_mb()
    posterior, parameters, near = _case(side)
    mdp = posterior.problem.mdp
    cold_s, elapsed_s, found = best_times(lambda: posterior.evaluate(parameters))
    peak_mb = peak_memory_mb()
    value, bound = found.solution.value, found.solution.error_bound
    del found
    warm_s = None
    if mdp.n_states <= MOST_WARM:
        before = posterior.evaluate(near).solution.value
        warm_s, _ = best_of(lambda: posterior.evaluate(parameters, before))
    moved_bytes = 12 * mdp.transitions.n_entries + 8 * mdp.n_states * (3 * mdp.n_actions + 2)
    sweep_s = _sweep_seconds(posterior, value)
    return {
        "states": mdp.n_states,
        "cold (ms)": 1e3 * cold_s,
        "cold, elapsed (ms)": 1e3 * elapsed_s,
        "warm (ms)": None if warm_s is None else 1e3 * warm_s,
        "error bound": bound,
        "peak memory (MB)": peak_mb,
        "of which Python and libraries (MB)": base_mb,
        "sweep (ms)": 1e3 * sweep_s,
        "sweep (GB/s)": moved_bytes / sweep_s / 1e9,
        "profile": _profile(lambda: posterior.evaluate(parameters)) if warm_s else [],
    }


def _in_own_process(side: int) -> dict[str, Any]:
    command = [sys.executable, "-m", "lab.benchmarks.learning.growth", str(side)]
    print(f"growth: {side * side:,} states", file=sys.stderr, flush=True)
    done = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True)
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def _case(side: int) -> tuple[Posterior, Parameters, Parameters]:
    """The posterior, parameters, and the same with smaller weights."""
    world = landscape_problem(side, DISCOUNT)
    available = world.problem.mdp.available
    random = np.broadcast_to(1.0 / available.shape[1], available.shape)
    rng = np.random.default_rng(0)
    decisions = sample_decisions(
        world.problem.mdp, random, DYNAMICS, world.starts, n_episodes=50, n_steps=40, rng=rng
    )
    posterior = objective_of(world.problem, decisions)
    at, near = (
        starting_parameters(world.problem, posterior.policy_model, share * WEIGHTS, DYNAMICS)
        for share in (1.0, 0.99)
    )
    return posterior, at, near


def _sweep_seconds(posterior: Posterior, value: np.ndarray) -> float:
    mdp = posterior.problem.mdp
    problem = BellmanProblem(
        posterior.policy_model.equation,
        rewards(posterior.problem, WEIGHTS),
        transitions_of(mdp.transitions, DYNAMICS),
        mdp,
    )
    return best_of(lambda: backup(problem, value))[0]


def _profile(work: Callable[[], Any]) -> list[dict[str, Any]]:
    """The functions with the largest shares of the time spent in themselves."""
    profile = cProfile.Profile(time.process_time)
    began_s = time.process_time()
    while time.process_time() - began_s < PROFILED_S:
        profile.runcall(work)
    stats = pstats.Stats(profile).stats  # type: ignore[attr-defined]
    total_s = sum(own_s for _, _, own_s, _, _ in stats.values())
    largest = sorted(stats.items(), key=lambda item: -item[1][2])[:PROFILE_LINES]
    return [
        {"function": _name(*where), "calls": calls, "share": round(own_s / total_s, 3)}
        for where, (_, calls, own_s, _, _) in largest
    ]


def _name(file: str, _: int, function: str) -> str:
    """Module and function, without the machine's folders."""
    if file == "~":
        return function.strip("<>")
    parts = file.removesuffix(".py").split("/")
    for package in ("serd_core", "scipy", "numpy"):
        if package in parts:
            parts = parts[parts.index(package) :]
    return f"{'.'.join(parts[-3:])}.{function}"


if __name__ == "__main__":
    print(json.dumps(measure(int(sys.argv[1]))))
