"""A live stack whose nodes run each by itself, driven towards north without people, and observed.

Without the supervisor of `serd launch` the other nodes continue when one of them ends, as they do
on a robot. What drives is the source of the stack: a goal of the strategy (goto), a page with a
held key (teleop), intents that this process publishes (live).
"""

import asyncio
import math
import signal
import subprocess
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import rclpy
from aiohttp import ClientError, ClientSession
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped, Vector3Stamped
from nav_msgs.msg import Odometry
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor

from serd_cli.processes.node_commands import stack_processes
from serd_core.grid.grid import Action
from serd_ros.convert.command import to_intent
from serd_ros.convert.diagnostics import OK
from serd_ros.convert.pose import from_odometry, from_pose_stamped, to_pose_stamped
from serd_ros.endpoints import qos
from serd_ros.graph.graph import find_stack
from serd_ros.process.progress import VARIABLE, parse_progress

#: The source of intents of the stack live, which this process is.
SOURCE = "source of intents"
_STANDS_MPS = 1e-3
_PATIENCE_S = 300.0
_WATCHED_S = 10.0
_RESUMED_S = 3.0
_TRIES = 20
_SILENCE_S = 2.0
_INTENT_PERIOD_S = 0.5
_N_NEUTRAL = 3
_GOAL_M = (12.0, 18.0)


@dataclass(frozen=True)
class Standing:
    """How a fault ended the motion, by the stamps of odom and robot_pose since the fault.

    after_s: until the robot stood; NaN where the stamps ended before, infinite where it still drove
    after 10 s. distance_m: driven until then. reports: warnings on `diagnostics` since the fault,
    as `node: message`.
    """

    after_s: float
    distance_m: float
    reports: tuple[str, ...]


class Motion:
    """Takes odom, robot_pose and diagnostics in a node that is spun by hand."""

    def __init__(self, environment: Mapping[str, str]) -> None:
        self._context = Context()
        self._context.init(domain_id=int(environment["ROS_DOMAIN_ID"]))
        self.node = rclpy.create_node("kill_matrix", context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self.time_s, self.speed_mps, self.way_m = math.nan, 0.0, 0.0
        self.reports: list[str] = []
        self.heard_s = time.monotonic()
        self._place: tuple[float, float] | None = None
        self.node.create_subscription(Odometry, "odom", self._on_odometry, qos.STATE)
        self.node.create_subscription(PoseStamped, "robot_pose", self._on_pose, qos.STATE)
        self.node.create_subscription(DiagnosticArray, "diagnostics", self._on_health, qos.STATE)

    def spin_until(self, condition: Callable[[], object], limit_s: float = _PATIENCE_S) -> bool:
        """Take messages until the condition holds; whether it did within the limit."""
        end_s = time.monotonic() + limit_s
        while not condition():
            if time.monotonic() > end_s:
                return False
            self._executor.spin_once(timeout_sec=0.02)
        return True

    def close(self) -> None:
        """End the node."""
        self.node.destroy_node()
        self._context.try_shutdown()

    def _on_odometry(self, message: Odometry) -> None:
        stamp_ns, _, (speed_mps, _) = from_odometry(message)
        self.time_s, self.speed_mps = stamp_ns * 1e-9, abs(speed_mps)
        self.heard_s = time.monotonic()

    def _on_pose(self, message: PoseStamped) -> None:
        _, (x_m, y_m, _) = from_pose_stamped(message)
        if self._place is not None:
            self.way_m += math.hypot(x_m - self._place[0], y_m - self._place[1])
        self._place = x_m, y_m

    def _on_health(self, message: DiagnosticArray) -> None:
        for status in message.status:
            report = f"{status.name}: {status.message}"
            if status.level != OK and report not in self.reports:
                self.reports.append(report)


class HeldKey:
    """A page that holds the direction north; a client of the page's WebSocket, in a thread."""

    def __init__(self, url: str) -> None:
        self._url, self._ended = url, threading.Event()
        self._n_neutral = 0
        self._thread = threading.Thread(target=lambda: asyncio.run(self._run()), daemon=True)
        self._thread.start()

    @property
    def is_held(self) -> bool:
        """Whether the key is held, and not about to be pressed."""
        return self._n_neutral > _N_NEUTRAL

    def press_anew(self) -> None:
        """Release the key and press it again."""
        self._n_neutral = 0

    def close(self) -> None:
        """Close the page."""
        self._ended.set()
        self._thread.join()

    async def _run(self) -> None:
        with suppress(ClientError, ConnectionError):
            async with (
                ClientSession() as session,
                session.ws_connect(f"{self._url}socket", origin=self._url.rstrip("/")) as socket,
            ):
                while not self._ended.is_set() and not socket.closed:
                    direction = "north" if self.is_held else None
                    self._n_neutral += direction is None
                    await socket.send_json({"type": "hold", "direction": direction})
                    await asyncio.sleep(0.1)


class DrivenStack:
    """Starts the nodes of a stack one by one; use it in `with`."""

    def __init__(
        self, stack: str, given: Mapping[str, Any], environment: Mapping[str, str], folder: Path
    ) -> None:
        self._stack, self._folder = stack, folder
        self._environment = {**environment, VARIABLE: "1"}
        self._page: HeldKey | None = None
        self._publishes = True
        self.fault_time_s = math.nan
        self._due_s = 0.0
        processes = stack_processes(find_stack(stack), given, environment)
        self._nodes = {each.name: self._start(each.name, each.command) for each in processes}
        self.motion = Motion(environment)
        self._intents = self.motion.node.create_publisher(Vector3Stamped, "intent", qos.COMMAND)

    def __enter__(self) -> "DrivenStack":
        return self

    def __exit__(self, *_: object) -> None:
        if self._page is not None:
            self._page.close()
        for process in self._nodes.values():
            process.send_signal(signal.SIGCONT)
            process.terminate()
        for process in self._nodes.values():
            process.wait(_PATIENCE_S)
        self.motion.close()

    def drive(self, speed_mps: float = 0.4) -> None:
        """Drive until this speed is reached."""
        self._begin()
        for _ in range(_TRIES):
            if self._spin(lambda: self._drives(speed_mps), _PATIENCE_S / _TRIES):
                return
            if self._page is not None:
                self._page.press_anew()  # a late page has stopped the robot
        raise RuntimeError(f"the robot must drive in stack {self._stack}; see {self._folder}")

    def _drives(self, speed_mps: float) -> bool:
        return self.motion.speed_mps > speed_mps and (self._page is None or self._page.is_held)

    def inject(self, node: str, number: signal.Signals) -> Standing:
        """Send a signal to a node, or end the source of intents; how the motion ends."""
        motion = self.motion
        motion.reports.clear()
        since_s, before_m = motion.time_s, motion.way_m
        self.fault_time_s = since_s
        if node == SOURCE:
            self._publishes = False
        else:
            self._nodes[node].send_signal(number)
        motion.heard_s = time.monotonic()
        stamps_come = self._spin_while_stamps_come(
            lambda: motion.speed_mps < _STANDS_MPS or motion.time_s > since_s + _WATCHED_S
        )
        after_s = motion.time_s - since_s if stamps_come else math.nan
        if stamps_come and motion.speed_mps >= _STANDS_MPS:
            after_s = math.inf
        distance_m, until_s = motion.way_m - before_m, motion.time_s + 1.0
        self._spin_while_stamps_come(lambda: motion.time_s > until_s)
        return Standing(after_s, distance_m, tuple(motion.reports))

    def _spin_while_stamps_come(self, condition: Callable[[], bool]) -> bool:
        """Until the condition holds or odom is silent; whether the condition held."""
        self._spin(lambda: condition() or time.monotonic() - self.motion.heard_s > _SILENCE_S)
        return condition()

    def resume(self, node: str) -> bool:
        """Continue a stopped node; whether the robot drives within some simulated seconds."""
        self._nodes[node].send_signal(signal.SIGCONT)
        motion = self.motion
        self._spin(lambda: motion.time_s >= 0.0 and time.monotonic() - motion.heard_s < 0.1, 10.0)
        since_s = motion.time_s
        self._spin(lambda: motion.speed_mps > 0.1 or motion.time_s > since_s + _RESUMED_S, 30.0)
        return motion.speed_mps > 0.1

    def _begin(self) -> None:
        motion = self.motion
        self._spin(lambda: motion.time_s > 0.0)
        if self._stack == "goto":
            goals = motion.node.create_publisher(PoseStamped, "goal_pose", qos.COMMAND)
            self._spin(goals.get_subscription_count)
            goals.publish(to_pose_stamped((*_GOAL_M, 0.0), 0.0))
        elif self._stack == "teleop":
            if not self._spin(self._page_address):
                raise RuntimeError(f"teleop_page must report its address, see {self._folder}")
            self._page = HeldKey(self._page_address())

    def _page_address(self) -> str:
        """What teleop_page has reported, empty before it has."""
        lines = (self._folder / "teleop_page.log").read_text().splitlines()
        return next((each.address for line in lines if (each := parse_progress(line))), "")

    def _spin(self, condition: Callable[[], object], limit_s: float = _PATIENCE_S) -> bool:
        def publish_and_look() -> object:
            self._publish()
            return condition()

        return self.motion.spin_until(publish_and_look, limit_s)

    def _publish(self) -> None:
        """Publish the next intent of the stack live, unless its source has ended."""
        if self._stack == "live" and self._publishes and self.motion.time_s >= self._due_s:
            self._due_s = self.motion.time_s + _INTENT_PERIOD_S
            self._intents.publish(to_intent(Action.NORTH, self.motion.time_s))

    def _start(self, name: str, command: Sequence[str]) -> "subprocess.Popen[bytes]":
        with (self._folder / f"{name}.log").open("wb") as log:
            return subprocess.Popen(
                command, env=self._environment, stdout=log, stderr=subprocess.STDOUT
            )
