"""How many times faster than real time the hallway runs: in process, and through ROS in lock-step.

The same seed, the same expert, the same 30 people and trajectory; only what carries the messages
differs. The profile gives the time of each part of a step.
"""

import subprocess

from lab.benchmarks.driving.step_profile import StepProfile, profile_steps
from lab.benchmarks.faults.kill_matrix import place
from lab.benchmarks.report import Row, save
from serd_bag.files import atomic_write_text
from serd_cli.processes.node_commands import stack_processes
from serd_files.episode_table import load_episodes
from serd_files.yaml_config import model_yaml
from serd_ros.graph.graph import find_stack
from serd_sim.planning.catalogue import planner_names
from serd_sim.scenario.scenario import Scenario, load_scenario

PEOPLE, SEED, EPISODES = 30, 3, 5
_WITHOUT_RECORDER = {
    "hallway_sim.required_nodes": ["local_planner", "guard", "scripted_expert"],
    "local_planner.required_nodes": ["guard"],
    "guard.required_nodes": ["hallway_sim"],
    "scripted_expert.required_nodes": ["hallway_sim", "local_planner", "guard"],
}


def run() -> None:
    """Measure in process with a profile, then through ROS."""
    scenario = load_scenario("hallway").with_pedestrian_count(PEOPLE)
    profiles, factors = _in_process(scenario)
    factors |= {
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
    messages = factors["ROS lock-step"] / factors["in process"]
    _save_profile(profiles, 1.0 - messages)


def _in_process(scenario: Scenario) -> tuple[dict[str, StepProfile], dict[str, float]]:
    """By planner and way of driving: profiles, and times faster than real time."""
    profiles = {
        name: profile_steps(scenario, seed=SEED, episodes=EPISODES, planner=name)
        for name in planner_names()
    }
    unguarded = profile_steps(scenario, seed=SEED, episodes=EPISODES, guarded=False)
    return profiles, {
        "in process": profiles["dwa"].real_time_factor,
        "in process, no guard": unguarded.real_time_factor,
    }


def _save_profile(profiles: dict[str, StepProfile], message_share: float) -> None:
    rows: list[Row] = []
    for planner, profile in profiles.items():
        for part, part_us in sorted(profile.parts_us.items(), key=lambda each: -each[1]):
            rows.append(
                {"planner": planner, "part": part, "us": part_us, "share": profile.share(part)}
            )
    dwa = profiles["dwa"]
    save(
        "step_profile",
        f"A step in process, {PEOPLE} people. Next bottleneck: the {dwa.bottleneck}, "
        f"{dwa.share(dwa.bottleneck):.0%} of a step; through ROS the messages, "
        f"{message_share:.0%} of a step",
        rows,
    )


def _through_ros(scenario: Scenario, *, recorded: bool) -> float:
    stack = find_stack("demonstrate")
    if not recorded:
        nodes = tuple(node for node in stack.nodes if node != "demo_recorder")
        stack = stack.model_copy(update={"nodes": nodes, "parameters": {}})
    with place() as (environment, folder):
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
