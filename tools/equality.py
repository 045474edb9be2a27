"""What users see of this tree, recorded before a change of its structure and compared after it.

    .venv/bin/python tools/equality.py record before.json
    .venv/bin/python tools/equality.py compare before.json [--only trajectories values]

Parts: `trajectories`, hashes of every pose of episodes; `values`, numbers of serd_core on random
problems; `bags`, what serd-bag prints and writes for whole and damaged recordings; `files`, what
commands write and print; `wire`, the messages of stacks in lock-step for one seed. Numbers may
differ by 1e-12 of their size, everything else not at all. Paths and wall times are left out.
"""

import argparse
import contextlib
import hashlib
import io
import json
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
SERD = str(Path(sys.executable).with_name("serd"))
RECORDINGS = ROOT / "bags/data/hallway"
Found = dict[str, Any]
TOLERANCE = 1e-12
_WALL_TIMES = r'"?(wall_s|created|duration_ms|seconds|learned_at|written)"?[:=] ?"?[^,"}\n]+'


def digest(content: bytes | str) -> str:
    """A short hash."""
    data = content.encode() if isinstance(content, str) else content
    return hashlib.sha256(data).hexdigest()[:16]


def trajectories(_: Path) -> Found:
    """Every pose of 13 episodes: robots, crowds, people given or by scans, no guard."""
    from serd_sim.drivers.catalogue import make_driver
    from serd_sim.episodes.batch import scenario_of
    from serd_sim.episodes.episode import run_episode
    from serd_sim.perception.scanning_planner import planner_in_world
    from serd_sim.safety.world_guard import no_guard
    from serd_sim.world.world import HallwayWorld

    found: Found = {}

    def drive(name: str, scenario: Any, people_from: str, seed: int, **more: Any) -> None:
        poses = hashlib.sha256()

        def see(*seen: Any) -> None:
            for each in seen:
                if hasattr(each, "pose"):
                    poses.update(np.array(each.pose).tobytes())

        with HallwayWorld(scenario, seed=seed) as world:
            record = run_episode(
                world,
                planner_in_world(world, people_from),
                make_driver(more.pop("driver", "expert_with_flow"), scenario, seed),
                episode=0,
                start_area="train",
                observer=see,
                **more,
            )
        found[name] = [poses.hexdigest()[:16], record.outcome, record.duration_s]

    for seed in range(2):
        for people_from in ("given", "scan"):
            hallway = scenario_of("hallway", 30)
            drive(f"dwa {people_from} {seed}", hallway, people_from, seed)
    hallway = scenario_of("hallway", 30)
    drive("no guard", hallway, "given", 3, guard=no_guard)
    drive("60 people", scenario_of("hallway", 60), "given", 4)
    drive("no people", scenario_of("hallway", 0), "given", 5)
    for driver in ("expert", "varied_expert", "hasty_expert"):
        drive(driver, hallway, "given", 6, driver=driver)
    kinematic = hallway.model_copy(
        update={"robot": hallway.robot.model_copy(update={"drive": "kinematic"})}
    )
    drive("kinematic", kinematic, "given", 7)
    for model in ("helbing_molnar_1995", "collision_prediction"):
        people = hallway.pedestrians.model_copy(update={"model": model})
        crowd = hallway.model_copy(update={"pedestrians": people})
        drive(model, crowd, "given", 8)
    return found


def values(_: Path) -> Found:
    """Policies, likelihoods, fits, their curvature, draws and arrival times on random problems."""
    import serd_core as sc

    found: Found = {}
    for seed in range(20):
        rng = np.random.default_rng(seed)
        n_states = 8 + 2 * (seed % 5)
        successors = np.array(
            [[rng.permutation(n_states)[:3] for _ in range(2)] for _ in range(n_states)]
        )
        model_of = rng.integers(0, 2, size=(n_states, 2))
        model_of[0] = 0, 1
        available = np.ones((n_states, 2), dtype=bool)
        problem = sc.TabularProblem(
            sc.Mdp(sc.OutcomeModels(successors, model_of, available, 2), 0.9),
            rng.normal(size=(n_states, 2, 2)),
            ("first", "second"),
        )
        chances, weights = rng.dirichlet(np.ones(3), size=2), rng.normal(size=2)
        expert = sc.soft_policy(problem, weights, chances)
        keep(found, f"{seed} policy", expert.probabilities[:, 0], expert.value)
        decisions = sc.sample_decisions(
            problem.mdp, expert.probabilities, chances, n_episodes=20, n_steps=15, rng=rng
        )
        found[f"{seed} decisions"] = digest(decisions.state.tobytes() + decisions.action.tobytes())
        keep(found, f"{seed} counted", sc.estimate_dynamics(problem, decisions))
        start = {"initial_weights": 0.1 * weights}
        evidence = sc.PriorByEvidence()
        fits = {
            "serd": sc.fit_mdce_serd(problem, decisions, **start),
            "serd by evidence": sc.fit_mdce_serd(problem, decisions, prior=evidence, **start),
            "irl": sc.fit_mdce_irl_by_likelihood(problem, decisions, **start),
            "pm_serd": sc.fit_pm_serd(problem, decisions, **start),
        }
        for name, fit in fits.items():
            policy = sc.fitted_policy(problem, fit)
            likelihood = sc.policy_log_likelihood(problem, decisions, policy)
            keep(found, f"{seed} {name}", fit.reward_weights, fit.outcome_probabilities, likelihood)
        fit = fits["serd by evidence"]
        draws = sc.laplace_draws(
            sc.laplace(problem, decisions, fit), np.random.default_rng(seed), 20
        )
        keep(found, f"{seed} draws", draws.outcome_probabilities.mean(axis=0))
    return found


def keep(found: Found, name: str, *numbers: Any) -> None:
    """Add arrays as lists, however they are shaped."""
    for at, each in enumerate(numbers):
        found[f"{name} {at}"] = np.asarray(each, dtype=np.float64).ravel().tolist()


def bags(folder: Path) -> Found:
    """Exit code, output and files of each serd-bag command for 148 recordings."""
    from serd_bag.command.main import main

    found: Found = {}
    for bag in sorted(damaged_bags(folder / "bags")):
        for command in ("info", "check", "recover", "convert"):
            output = folder / "out" / f"{bag.name}-{command}"
            words = [command, "--json", str(bag)]
            if command in ("recover", "convert"):
                words += ["--output", str(output)]
            printed, errors = io.StringIO(), io.StringIO()
            with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(errors):
                code = main(words)
            text = plain(printed.getvalue() + errors.getvalue(), folder)
            found[f"{bag.name} {command}"] = [code, digest(text), files_of(output)]
    return found


def damaged_bags(folder: Path) -> Iterator[Path]:
    """Three recordings whole, and each cut and changed at 48 places."""
    folder.mkdir(parents=True)
    rng = np.random.default_rng(0)
    for name in ("training", "test", "transfer"):
        data = next((RECORDINGS / name).glob("*.mcap")).read_bytes()
        whole = folder / f"{name}.mcap"
        whole.write_bytes(data)
        yield whole
        for at in range(48):
            place = int(rng.integers(0, len(data)))
            changed = bytearray(data)
            if at % 2:
                changed = changed[:place]
            else:
                changed[place : place + 16] = rng.bytes(16)
            damaged = folder / f"{name}-{at}.mcap"
            damaged.write_bytes(changed)
            yield damaged
    empty = folder / "empty.mcap"
    empty.write_bytes(b"")
    yield empty


def files(folder: Path) -> Found:
    """What commands write and print for the shipped recordings and for a table."""
    table = folder / "walk.csv"
    rng = np.random.default_rng(1)
    rows = ["agent,time,x,y"]
    for agent in range(4):
        start_m = rng.uniform(0.0, 2.0, 2)
        rows += [f"{agent},{t:.1f},{start_m[0] + t:.3f},{start_m[1]:.3f}" for t in range(9)]
    table.write_text("\n".join(rows) + "\n")
    commands = {
        "demos": ["demos", str(RECORDINGS / "training"), "--scenario", "hallway"],
        "learn": ["learn", "decisions.csv", "--method", "mdce_serd_evidence"],
        "irl": ["learn", "decisions.csv", "--method", "mdce_irl", "--output", "irl.yaml"],
        "report": ["report", "model.yaml", "--output", "page"],
        "table": ["demos", str(table), "--output", "walk-decisions.csv"],
        "scenario": ["scenario", "show", "hallway", "--json"],
    }
    found: Found = {}
    for name, words in commands.items():
        done = run([SERD, *words], folder)
        found[name] = [done.returncode, digest(plain(done.stdout, folder))]
    for path in sorted(each for each in folder.rglob("*") if each.suffix in (".csv", ".yaml")):
        found[str(path.relative_to(folder))] = digest(plain(path.read_text(), folder))
    return found


def wire(folder: Path) -> Found:
    """Messages by topic of the stack demonstrate for one seed, without diagnostics."""
    from serd_bag.reader import BagReader

    words = [
        "launch",
        "demonstrate",
        "episodes:=1",
        "seed:=3",
        "people:=10",
        "demo_recorder.output:=bag",
    ]
    done = run([SERD, *words], folder)
    topics: dict[str, list[str]] = {}
    for message in BagReader(folder / "bag").messages():
        topics.setdefault(message.topic, []).append(digest(message.data))
    counted = {
        topic: [len(each), digest("".join(sorted(set(each))))]
        for topic, each in topics.items()
        if not topic.endswith(("diagnostics", "episode"))
    }
    return {"exit code": done.returncode, **counted}


def run(words: list[str], folder: Path) -> "subprocess.CompletedProcess[str]":
    """Run a command of this tree in a folder."""
    packages = os.pathsep.join(str(ROOT / each) for each in ("", "sim", "bags"))
    environment = {**os.environ, "PYTHONPATH": packages, "COLUMNS": "100", "SERD_QUIET": "1"}
    return subprocess.run(
        words, cwd=folder, env=environment, capture_output=True, text=True, check=False
    )


def plain(text: str, folder: Path) -> str:
    """Text without paths of this machine and wall times."""
    text = text.replace(str(folder), "FOLDER").replace(str(ROOT), "ROOT")
    return re.sub(r"\d+(\.\d+)? (ms|s)\b", "TIME", re.sub(_WALL_TIMES, "TIME", text))


def files_of(folder: Path) -> Any:
    """Hash of each file below a folder."""
    if not folder.exists():
        return None
    paths = [folder] if folder.is_file() else sorted(p for p in folder.rglob("*") if p.is_file())
    return {path.name.replace(folder.name, "NAME"): digest(path.read_bytes()) for path in paths}


PARTS: dict[str, Callable[[Path], Found]] = {
    each.__name__: each for each in (trajectories, values, bags, files, wire)
}


def differences(before: Any, after: Any, name: str = "") -> Iterator[str]:
    """Names and contents of what is not the same."""
    if isinstance(before, dict) and isinstance(after, dict):
        for key in sorted({*before, *after}):
            yield from differences(before.get(key), after.get(key), f"{name}/{key}")
    elif isinstance(before, list) and isinstance(after, list) and len(before) == len(after):
        for at, (one, other) in enumerate(zip(before, after, strict=True)):
            yield from differences(one, other, f"{name}[{at}]")
    elif isinstance(before, float) and isinstance(after, float):
        if not np.isclose(before, after, rtol=TOLERANCE, atol=TOLERANCE, equal_nan=True):
            yield f"{name}: {before} is now {after}"
    elif before != after:
        yield f"{name}: {before} is now {after}"


def main() -> int:
    """Entry point."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("do", choices=("record", "compare"))
    parser.add_argument("path", type=Path, help="JSON file of what was seen")
    parser.add_argument("--only", nargs="+", choices=PARTS, default=tuple(PARTS))
    given = parser.parse_args()
    seen: Found = {}
    for name in given.only:
        with tempfile.TemporaryDirectory() as folder:
            seen[name] = json.loads(json.dumps(PARTS[name](Path(folder))))
        print(f"{name}: {len(seen[name])} results", flush=True)
    if given.do == "record":
        given.path.write_text(json.dumps(seen, indent=1) + "\n")
        return 0
    before = json.loads(given.path.read_text())
    found = [line for name in given.only for line in differences(before[name], seen[name], name)]
    print("\n".join(found) or "equal")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
