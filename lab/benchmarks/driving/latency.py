"""Time from a pose to the `cmd_vel` that answers it, in the live stack driven by intents.

Times are those of publishing, by the middleware's source time stamps of one machine. The answer of
a pose is the first `cmd_vel` after the `cmd_vel_raw` with the pose's stamp; a pose without one is
unanswered.
"""

import os
import subprocess
from collections.abc import Sequence
from contextlib import ExitStack

import numpy as np
import rclpy
from geometry_msgs.msg import Vector3Stamped
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor

from lab.benchmarks.faults.kill_matrix import place
from lab.benchmarks.report import Row, save
from serd_bag.messages.plain import message_stamp_ns
from serd_cli.processes.node_commands import stack_processes
from serd_core.arrays import FloatArray
from serd_core.grid.grid import Action
from serd_ros.convert.command import to_intent
from serd_ros.endpoints import qos, topics
from serd_ros.endpoints.followed_topic import FollowedTopic, Received
from serd_ros.endpoints.topic_types import topic_type
from serd_ros.graph.graph import find_stack
from serd_sim.scenario.scenario import load_scenario

PEOPLE, SEED, N_POSES = 30, 3, 640
_TOPICS = (topics.ROBOT_POSE, topics.CMD_VEL_RAW, topics.CMD_VEL)
#: Poses at the beginning and the end that are not counted.
_N_BORDER = 20
_PATIENCE_S = 600.0


def run() -> None:
    """Measure both planners on the machine as it is."""
    scenario = load_scenario("hallway")
    rows: list[Row] = []
    for planner in ("dwa", "mppi"):
        late_s = latencies_s(*published(planner))
        answered = late_s[np.isfinite(late_s)]
        rows.append(
            {
                "planner": planner,
                "poses": len(late_s),
                "unanswered": int(len(late_s) - len(answered)),
                "median (ms)": round(1e3 * float(np.median(answered)), 1),
                "95 % (ms)": round(1e3 * float(np.quantile(answered, 0.95)), 1),
                "most (ms)": round(1e3 * float(answered.max()), 1),
                "95 % (control periods)": round(
                    float(np.quantile(answered, 0.95)) / scenario.control_period_s, 2
                ),
            }
        )
    about = (
        f"From a pose to cmd_vel, live, {PEOPLE} people; load of the machine at the end"
        f" {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores"
    )
    save("latency", about, rows)


def latencies_s(
    poses: Sequence[Received], raw: Sequence[Received], commands: Sequence[Received]
) -> FloatArray:
    """Seconds from each counted pose to its answer, infinite without one."""
    answer_ns: dict[int, int] = {}
    for each in raw:
        answer_ns.setdefault(message_stamp_ns(each.data), each.sent_ns)
    sent_ns = np.sort(np.array([each.sent_ns for each in commands], dtype=np.int64))
    late_s = []
    for pose in poses[_N_BORDER:-_N_BORDER]:
        after_ns = answer_ns.get(message_stamp_ns(pose.data))
        found = len(sent_ns) if after_ns is None else int(np.searchsorted(sent_ns, after_ns))
        is_answered = found < len(sent_ns)
        late_s.append((sent_ns[found] - pose.sent_ns) * 1e-9 if is_answered else np.inf)
    return np.array(late_s, dtype=np.float64)


def published(planner: str) -> tuple[list[Received], ...]:
    """What was published on the topics from the first command on."""
    taken: dict[str, list[Received]] = {name: [] for name in _TOPICS}
    with ExitStack() as stack:
        environment, _ = stack.enter_context(place())
        given = {
            "hallway_sim.people": PEOPLE,
            "seed": SEED,
            "planner": planner,
            "stamped_cmd_vel": True,
        }
        for process in stack_processes(find_stack("live"), given, environment):
            running = subprocess.Popen(process.command, env=environment, stderr=subprocess.DEVNULL)
            stack.callback(running.wait)
            stack.callback(running.terminate)
        context = Context()
        context.init(domain_id=int(environment["ROS_DOMAIN_ID"]))
        stack.callback(context.try_shutdown)
        node = rclpy.create_node("latency", context=context)
        stack.callback(node.destroy_node)
        intents = node.create_publisher(Vector3Stamped, topics.INTENT, qos.COMMAND)

        def take(name: str, message: Received) -> None:
            if name == topics.ROBOT_POSE:
                intents.publish(to_intent(Action.EAST, message_stamp_ns(message.data) * 1e-9))
            if taken[topics.CMD_VEL] or name == topics.CMD_VEL:
                taken[name].append(message)

        followed = [
            FollowedTopic(
                node,
                f"/{name}",
                topic_type(name, stamped_cmd_vel=True),
                lambda message, name=name: take(name, message),
            )
            for name in _TOPICS
        ]
        executor = SingleThreadedExecutor(context=context)
        executor.add_node(node)
        deadline_ns = node.get_clock().now().nanoseconds + round(_PATIENCE_S * 1e9)
        while len(taken[topics.ROBOT_POSE]) < N_POSES:
            executor.spin_once(timeout_sec=0.1)
            if node.get_clock().now().nanoseconds > deadline_ns:
                raise RuntimeError(f"{N_POSES} poses must come within {_PATIENCE_S:g} s")
        for each in followed:
            each.close()
    return tuple(taken[name] for name in _TOPICS)
