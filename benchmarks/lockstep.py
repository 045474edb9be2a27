"""How many times faster than real time the hallway runs: in process, and through ROS in lock-step.

The same seed, the same expert, the same trajectory; only what carries the messages differs.
"""

import os
import subprocess
import tempfile
import time
from pathlib import Path

from domain_coordinator import domain_id

from benchmarks.report import Row, save
from serd_cli.node_commands import stack_processes
from serd_cli.workspace import ros_environment
from serd_ros.graph import find_stack
from sim.episode import run_episode
from sim.expert import ScriptedExpert
from sim.planners import make_planner
from sim.scenario import load_scenario
from sim.world import HallwayWorld
from storage.episode_table import load_episodes

SEED, EPISODES = 3, 5
_WITHOUT_RECORDER = {
    "hallway_sim.required_nodes": ["local_planner", "scripted_expert"],
    "local_planner.required_nodes": ["hallway_sim"],
    "scripted_expert.required_nodes": ["hallway_sim", "local_planner"],
}


def run() -> None:
    """Measure all three ways in one run."""
    in_process = _in_process()
    rows: list[Row] = []
    for name, factor in (
        ("in process", in_process),
        ("ROS lock-step", _through_ros(recorded=False)),
        ("ROS lock-step, scan and all topics recorded", _through_ros(recorded=True)),
    ):
        rows.append({"way": name, "real_time_factor": factor, "of_in_process": factor / in_process})
    people = load_scenario("hallway").pedestrians.count
    save("lockstep", f"Times faster than real time, {people} people, {EPISODES} episodes", rows)


def _in_process() -> float:
    scenario = load_scenario("hallway")
    planner, expert = make_planner("dwa", scenario), ScriptedExpert(scenario, SEED)
    simulated_s = wall_s = 0.0
    with HallwayWorld(scenario, seed=SEED) as world:
        for episode in range(EPISODES):
            began_s = time.perf_counter()
            record = run_episode(world, planner, expert, episode=episode)
            wall_s += time.perf_counter() - began_s
            simulated_s += record.duration_s
    return simulated_s / wall_s


def _through_ros(*, recorded: bool) -> float:
    stack = find_stack("demonstrate")
    if not recorded:
        nodes = tuple(node for node in stack.nodes if node != "demo_recorder")
        stack = stack.model_copy(update={"nodes": nodes, "parameters": {}})
    with tempfile.TemporaryDirectory() as folder, domain_id() as domain:
        given = {"seed": SEED, "scripted_expert.episodes": EPISODES}
        given["scripted_expert.output"] = folder
        given |= {"demo_recorder.output": f"{folder}/bag"} if recorded else _WITHOUT_RECORDER
        environment = {**ros_environment(os.environ), "ROS_DOMAIN_ID": str(domain)}
        running = [
            subprocess.Popen(each.command, env=environment, stderr=subprocess.DEVNULL)
            for each in stack_processes(stack, given, environment)
        ]
        running[-1].wait()
        for process in running:
            process.terminate()
            process.wait()
        rows = load_episodes(Path(folder) / "episodes.csv")
    return sum(row.duration_s for row in rows) / sum(row.wall_s for row in rows)
