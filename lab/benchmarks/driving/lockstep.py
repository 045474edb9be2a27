"""How many times faster than real time the hallway runs: in process, and through ROS in lock-step.

The same seed, the same expert, the same 30 people and trajectory; only what carries the messages
differs.
"""

import os
import subprocess
import tempfile
import time
from pathlib import Path

from domain_coordinator import domain_id

from lab.benchmarks.report import Row, save
from serd_bag.files import atomic_write_text
from serd_cli.processes.workspace import ros_environment, stack_processes
from serd_files.episode_table import load_episodes
from serd_files.yaml_config import model_yaml
from serd_ros.graph.graph import find_stack
from serd_sim.drivers.expert import ScriptedExpert
from serd_sim.episodes.episode import run_episode
from serd_sim.planning.catalogue import make_planner
from serd_sim.safety.world_guard import no_guard
from serd_sim.scenario.scenario import Scenario, load_scenario
from serd_sim.world.world import HallwayWorld

PEOPLE, SEED, EPISODES = 30, 3, 5
_WITHOUT_RECORDER = {
    "hallway_sim.required_nodes": ["local_planner", "guard", "scripted_expert"],
    "local_planner.required_nodes": ["guard"],
    "guard.required_nodes": ["hallway_sim"],
    "scripted_expert.required_nodes": ["hallway_sim", "local_planner", "guard"],
}


def run() -> None:
    """Measure in process, then through ROS."""
    scenario = load_scenario("hallway").with_pedestrian_count(PEOPLE)
    factors = {
        "in process": _in_process(scenario, guarded=True),
        "in process, no guard": _in_process(scenario, guarded=False),
        "ROS lock-step": _through_ros(scenario, recorded=False),
        "ROS lock-step, all topics recorded": _through_ros(scenario, recorded=True),
    }
    rows: list[Row] = [
        {
            "way": way,
            "real_time_factor": factor,
            "step_us": 1e6 * scenario.control_period_s / factor,
        }
        for way, factor in factors.items()
    ]
    save("lockstep", f"Times faster than real time, {PEOPLE} people, {EPISODES} episodes", rows)


def _in_process(scenario: Scenario, *, guarded: bool) -> float:
    """Simulated over processor time from each first step on; all scans are made."""
    driven_s = processor_s = 0.0
    with HallwayWorld(scenario, seed=SEED) as world:
        driver, planner = ScriptedExpert(scenario, SEED), make_planner("dwa", scenario)
        began_s: list[float] = []

        def scan(*_: object) -> None:
            began_s.append(time.process_time())
            if world.is_scan_tick:
                world.scan()

        for episode in range(EPISODES):
            began_s.clear()
            guard = None if guarded else no_guard
            record = run_episode(
                world, planner, driver, episode=episode, guard=guard, observer=scan
            )
            processor_s += time.process_time() - began_s[0]
            driven_s += record.n_ticks * scenario.control_period_s
    return driven_s / processor_s


def _through_ros(scenario: Scenario, *, recorded: bool) -> float:
    stack = find_stack("demonstrate")
    if not recorded:
        nodes = tuple(node for node in stack.nodes if node != "demo_recorder")
        stack = stack.model_copy(update={"nodes": nodes, "parameters": {}})
    with tempfile.TemporaryDirectory() as name, domain_id() as domain:
        folder = Path(name)
        environment = {**ros_environment(os.environ), "ROS_DOMAIN_ID": str(domain)}
        environment["ROS_LOG_DIR"] = str(folder / "ros")
        file = folder / "scenario.yaml"
        atomic_write_text(file, model_yaml(scenario))
        given = {"scenario": str(file), "seed": SEED, "scripted_expert.episodes": EPISODES}
        given["scripted_expert.output"] = str(folder)
        given |= {"demo_recorder.output": f"{folder}/bag"} if recorded else _WITHOUT_RECORDER
        running = [
            subprocess.Popen(each.command, env=environment, stderr=subprocess.DEVNULL)
            for each in stack_processes(stack, given, environment)
        ]
        running[-1].wait()
        for process in running:
            process.terminate()
            process.wait()
        rows = load_episodes(folder / "episodes.csv")
    return sum(row.duration_s for row in rows) / sum(row.wall_s for row in rows)
