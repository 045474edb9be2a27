"""Goals and faults of the reference robots on the stacks of a robot, or on somebody else's guard.

Everything runs in real time, in processes and a ROS domain of its own. The robot, its localisation
and its Nav2 are stand-ins (`lab.faults.standin`): Nav2 is an action server with Nav2's tolerances,
whose commands pass the guard.
"""

import json
import math
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped, Twist
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from std_msgs.msg import String

from lab.faults.robots import robot_named
from serd_app.drives.drive import END
from serd_cli.processes.workspace import stack_processes
from serd_files.table import OptionalFloat, Row, RowTable, columns_of
from serd_ros.convert.diagnostics import from_episode_message
from serd_ros.convert.motion import to_pose_stamped, to_twist
from serd_ros.convert.typed import from_guard_state
from serd_ros.endpoints import qos
from serd_ros.endpoints.topic_types import TYPES
from serd_ros.graph.graph import find_stack
from serd_sim.errors import SimError
from serd_sim.world.command import Command

STACKS = ("robot", "robot_people", "robot_nav2")
#: Faults of what a robot publishes; those of people and of waypoints have no topic of a robot.
FIELD_FAULTS = (
    "scan_stops", "scan_nan", "scan_inf", "scan_near", "scan_zero", "scan_sector", "scan_frozen",
    "pose_stops", "pose_frozen", "pose_jumps", "odom_stops", "odom_twist", "odom_frozen",
    "delay_1s", "delay_3s",
)  # fmt: skip
#: The guard beside a stack that has none, as in the stack `robot`.
GUARD = find_stack("robot").parameters["guard"] | {"pose_from": "tf"}
MODEL = Path(__file__).resolve().parents[2] / "docs/pictures/demo_model.yaml"
#: A goal, a fault and what follows it may last so long (s).
_GOAL_S, WATCHED_S, _READY_S = 120.0, 9.0, 90.0
#: Places of goals in the hallway (m).
_EAST_M, _NORTH_M = (1.5, 2.5, 3.5, 4.5), (2.5, 3.5, 4.5, 5.5)
_FAST, _COMMAND_S = 0.85, 0.05
#: Reasons of a stop that are no fault of an input; the second one only makes the robot slower.
_NO_INPUT = ("collision", "does not look there", "cmd_vel")
#: Share of the rays ahead that show something where a fault hides them.
_SHOWN = 0.2

#: The driver was late where it published nothing for the first time (s) within the second (s).
_LATE_S, _AROUND_S = 0.15, 1.5


@dataclass(frozen=True)
class FieldRow:
    """A goal or a fault of a robot on a stack.

    ending: of the drive to a goal, else `stood`, `drove on` or `not begun`. zero_s, stood_s and
    stood_m: from the beginning of a fault, NaN where the robot did not stand within 9 s.
    Contacts are those of the outline by the truth. false_stops: stops of the guard for an input
    although the driver published in time; late_stops: those while it did not. reasons: of both.
    """

    robot: str
    stack: str
    task: str
    ending: str
    duration_s: float
    zero_s: OptionalFloat
    stood_s: OptionalFloat
    stood_m: OptionalFloat
    wall: int
    robot_on_person: int
    person_on_robot: int
    false_stops: int
    late_stops: int
    reasons: str


_KEYS = ("robot", "stack", "task")
_CONTACTS = ("wall", "robot_on_person", "person_on_robot")


def field_table(path: Path) -> RowTable:
    """The table of rows, which goes on where there is one."""
    return RowTable(path, columns_of(FieldRow), _KEYS)


class Field:
    """Watches and drives one robot in a namespace. node: of the caller, spun by `spin`."""

    def __init__(self, node: Node, spin: Callable[[], object], namespace: str) -> None:
        self._spin, self._namespace = spin, namespace
        self.node = node
        self.measured: dict[str, Any] = {}
        self.guard: dict[str, str] = {}
        self.endings: list[str] = []
        self.n_begun = 0
        #: Stops for an input: when, and why; when the driver was late.
        self._stops: list[tuple[float, str]] = []
        self._late_s: list[float] = []
        self._was_stopped = False
        self._goals = node.create_publisher(PoseStamped, self._name("goal_pose"), qos.COMMAND)
        self._disturb = node.create_publisher(String, self._name("disturb"), 10)
        node.create_subscription(String, self._name("measured"), self._on_measured, 10)
        node.create_subscription(DiagnosticArray, self._name("episode"), self._on_mark, qos.STATE)
        kind, name = TYPES["guard_state"].message, self._name("guard_state")
        node.create_subscription(kind, name, self._on_guard, qos.LATCHED, raw=True)

    def _name(self, topic: str) -> str:
        return f"{self._namespace}/{topic}"

    def _on_measured(self, message: String) -> None:
        self.measured = json.loads(message.data)
        if self.measured["gap_s"] > _LATE_S:
            self._late_s.append(time.monotonic())

    def _on_mark(self, message: DiagnosticArray) -> None:
        mark = from_episode_message(message)
        if mark.event == END:
            self.endings.append(mark.outcome)
        else:
            self.n_begun += 1

    def _on_guard(self, data: bytes) -> None:
        values = self.guard = from_guard_state(data)
        wrong = [
            each
            for each in values["reasons"].split(", ")
            if each and not any(text in each for text in _NO_INPUT)
        ]
        stopped = values["action"] == "STOP" and bool(wrong)
        if stopped and not self._was_stopped:
            self._stops.append((time.monotonic(), ", ".join(wrong)))
        self._was_stopped = stopped

    def until(self, condition: Callable[[], object], longest_s: float) -> bool:
        """Take messages until a condition holds; whether it did in time."""
        end_s = time.monotonic() + longest_s
        while not condition():
            if time.monotonic() > end_s:
                return False
            self._spin()
        return True

    def send_goal(self, x_m: float, y_m: float) -> bool:
        """Send a goal until its drive begins; one that is running leads to it, with no new mark.

        A goal that nobody takes yet would be lost.
        """
        n_begun = self.n_begun
        runs = n_begun > len(self.endings)
        self.until(self._goals.get_subscription_count, 30.0)
        for _ in range(3):
            self._goals.publish(to_pose_stamped((x_m, y_m, 0.0), 0.0))
            if runs or self.until(lambda: self.n_begun > n_begun, 30.0):
                return True
        return False

    def drive_goal(self, place_m: tuple[float, float], wait_s: float) -> dict[str, Any]:
        """Drive to a goal, which is sent after a while; its columns."""
        self.until(lambda: False, wait_s)
        began_s, n_ended, before = time.monotonic(), len(self.endings), self._contacts()
        self._stops, self._late_s = [], self._late_s[-1:]
        began = self.send_goal(*place_m)
        ended = began and self.until(lambda: len(self.endings) > n_ended, _GOAL_S)
        row = {"ending": self.endings[-1] if ended else "late", **self._since(began_s, before)}
        late = sum(
            any(abs(stop_s - late_s) < _AROUND_S for late_s in self._late_s)
            for stop_s, _ in self._stops
        )
        stops = {"false_stops": len(self._stops) - late, "late_stops": late}
        return row | stops | {"reasons": "; ".join(reasons for _, reasons in self._stops)}

    def _since(self, began_s: float, before: dict[str, int]) -> dict[str, Any]:
        """Duration and contacts since a time."""
        now = {name: count - before[name] for name, count in self._contacts().items()}
        return {"duration_s": time.monotonic() - began_s, **now}

    def disturb(self, name: str) -> None:
        """Make a fault, until an empty name ends it."""
        is_made = lambda: self.measured.get("fault") == name  # noqa: E731
        for _ in range(20):
            self._disturb.publish(String(data=name))
            if name == "home" or self.until(is_made, 1.0):
                return
        raise SimError(f"the robot does not take the fault {name!r}; look at what runs it")

    def run_fault(self, name: str, fast_mps: float, drive: Callable[[], object]) -> dict[str, Any]:
        """Make a fault at full speed; its columns. drive: keeps the robot driving."""
        began_s, before = time.monotonic(), self._contacts()

        def is_fast() -> bool:
            drive()
            hides = name != "scan_sector" or self.measured.get("shown_ahead", 0.0) > _SHOWN
            return hides and abs(float(self.measured.get("speed_mps", 0.0))) >= _FAST * fast_mps

        def stood() -> bool:
            drive()
            return self.measured.get("stood_s") is not None

        ending = "not begun"
        if self.until(is_fast, _GOAL_S):
            before = self._contacts()
            self.disturb(name)
            ending = "stood" if self.until(stood, WATCHED_S) else "drove on"
        times = {key: self.measured.get(key) for key in ("zero_s", "stood_s", "stood_m")}
        row = {key: math.nan if each is None else each for key, each in times.items()}
        row |= {"ending": ending, **self._since(began_s, before)}
        if ending != "not begun":
            self.disturb("")
        return row

    def _contacts(self) -> dict[str, int]:
        return {each: int(self.measured.get(each, 0)) for each in _CONTACTS}

    def goals_to_and_fro(self) -> Callable[[], None]:
        """What sends the farther end of the hallway as goal when a drive has ended."""
        state = {"ended": -1}

        def drive() -> None:
            if state["ended"] != len(self.endings) and self.measured:
                state["ended"] = len(self.endings)
                self.send_goal(3.5, 13.5 if self.measured["pose"][1] < 7.0 else 1.5)

        return drive

    def ahead(self, topic: str, speed_mps: float) -> Callable[[], None]:
        """What commands full speed ahead, from home where the robot has come far."""
        publisher = self.node.create_publisher(Twist, topic, 10)
        state = {"sent_s": 0.0}

        def drive() -> None:
            now_s = time.monotonic()
            if now_s - state["sent_s"] < _COMMAND_S:
                return
            state["sent_s"] = now_s
            if not self.measured.get("fault") and self.measured.get("pose", (0, 0))[1] > 15.0:
                self.disturb("home")
                self.until(lambda: self.measured["pose"][1] < 10.0, 2.0)
            publisher.publish(to_twist(Command(speed_mps, 0.0)))

        return drive


def standin_options(robot: str, stack: str, seed: int = 0) -> list[str]:
    """Options of the stand-in for a robot on a stack."""
    people = ["--people"] if stack == "robot_people" else []
    # SERD_REAL_NAV2: one that runs already serves the robot's goals, and publishes cmd_vel_raw.
    serves = stack == "robot_nav2" and "SERD_REAL_NAV2" not in os.environ
    nav2 = ["--nav2-output", "cmd_vel_raw"] if serves else []
    return [robot, "--seed", str(seed), *nav2, *people, "--ros-args", "-r", f"__ns:=/{robot}"]


def parameters_of(stack: str, scenario: Path, model: Path) -> dict[str, dict[str, Any]]:
    """By stack to start, its parameters: `robot_nav2` has a guard beside it."""
    shared = {"scenario": str(scenario)}
    found: dict[str, dict[str, Any]] = {
        stack: {**shared, "model": str(model), "strategy.patience_decisions": 0}
    }
    if stack == "robot_nav2":
        found["guard"] = {**shared, **GUARD}
    return found


@contextmanager
def running(
    robot: str, stack: str, folder: Path, environment: Mapping[str, str], model: Path, seed: int
) -> Iterator[None]:
    """The stand-in and the nodes of a stack, as processes whose logs go to a folder."""
    scenario = robot_named(robot).save_scenario(folder)
    commands = {
        "standin": [
            sys.executable,
            "-m",
            "lab.faults.standin",
            *standin_options(robot, stack, seed),
        ]
    }
    for name, given in parameters_of(stack, scenario, model).items():
        for each in stack_processes(find_stack(name), given, environment, f"/{robot}"):
            commands[each.name] = list(each.command)
    with _processes(commands, folder, environment):
        yield


@contextmanager
def _processes(
    commands: Mapping[str, list[str]], folder: Path, environment: Mapping[str, str]
) -> Iterator[None]:
    started = []
    try:
        for name, command in commands.items():
            with (folder / f"{name}.log").open("ab") as log:
                started.append(
                    subprocess.Popen(command, env=environment, stdout=log, stderr=subprocess.STDOUT)
                )
        yield
    finally:
        for each in started:
            each.terminate()
        for each in started:
            with suppress(subprocess.TimeoutExpired):
                each.wait(10.0)
            each.kill()
            each.wait()


@contextmanager
def field_of(namespace: str, domain: int) -> Iterator[Field]:
    """A field with a node of its own in a ROS domain."""
    context = Context()
    context.init(domain_id=domain)
    executor = SingleThreadedExecutor(context=context)
    try:
        node = Node("field", context=context)
        executor.add_node(node)
        yield Field(node, lambda: executor.spin_once(timeout_sec=0.02), namespace)
        executor.shutdown()
        node.destroy_node()
    finally:
        context.try_shutdown()


def run_field(
    robot: str,
    stack: str,
    folder: Path,
    environment: Mapping[str, str],
    table: RowTable,
    *,
    n_goals: int,
    faults: Sequence[str],
    model: Path = MODEL,
    seed: int = 0,
) -> None:
    """Add goals and faults of a robot on a stack that a table lacks. environment: with a domain."""
    goals = {f"goal {number + 1}": each for number, each in enumerate(_goals(n_goals, seed))}
    missing = [each for each in (*goals, *faults) if (robot, stack, each) not in table.rows]
    if not missing:
        return
    folder.mkdir(parents=True, exist_ok=True)
    domain = int(environment["ROS_DOMAIN_ID"])
    with (
        running(robot, stack, folder, environment, model, seed),
        field_of(f"/{robot}", domain) as seen,
    ):
        if not seen.until(lambda: is_ready(folder) and seen.measured, _READY_S):
            raise SimError(f"the stack {stack} does not start; read the logs in {folder}")
        drive = seen.goals_to_and_fro()
        for task in missing:
            if task in goals:
                columns = seen.drive_goal(*goals[task])
            else:
                columns = seen.run_fault(task, robot_named(robot).max_vel_x_mps, drive)
            _append(table, (robot, stack, task), columns)


def _goals(count: int, seed: int) -> list[tuple[tuple[float, float], float]]:
    """Places (m), each another than the one before, and how long (s) to wait before each."""
    rng = np.random.default_rng(seed)
    found: list[tuple[tuple[float, float], float]] = []
    while len(found) < count:
        place = float(rng.choice(_EAST_M)), float(rng.choice(_NORTH_M))
        if not found or place != found[-1][0]:
            found.append((place, float(rng.uniform(0.0, 0.3))))
    return found


def _append(table: RowTable, key: tuple[str, str, str], columns: Mapping[str, Any]) -> None:
    none: dict[str, Any] = dict.fromkeys(("zero_s", "stood_s", "stood_m"), math.nan)
    none |= {"false_stops": 0, "late_stops": 0, "reasons": ""}
    table.append({**dict(zip(_KEYS, key, strict=True)), **none, **columns})


def is_ready(folder: Path) -> bool:
    """Whether the strategy that logs to a folder waits for a goal."""
    log = folder / "strategy.log"
    return log.is_file() and "waiting for a goal" in log.read_text()


def run_guard(
    robot: str,
    topics: tuple[str, str],
    folder: Path,
    environment: Mapping[str, str],
    table: RowTable,
    faults: Sequence[str],
    seed: int = 0,
) -> None:
    """Faults of a robot before a guard that runs already: it takes commands and publishes others.

    topics: of the commands that it takes, and of those that reach the robot, in full. Its inputs
    are `odom`, `scan` and /tf in the namespace of the robot.
    """
    raw, out = topics
    stack, kind = f"{raw}:{out}", robot_named(robot)
    folder.mkdir(parents=True, exist_ok=True)
    options = [robot, "--seed", str(seed), "--cmd-vel", out]
    options += ["--ros-args", "-r", f"__ns:=/{robot}"]
    command = [sys.executable, "-m", "lab.faults.standin", *options]
    domain = int(environment.get("ROS_DOMAIN_ID", "0"))
    with (
        _processes({"standin": command}, folder, environment),
        field_of(f"/{robot}", domain) as seen,
    ):
        drive = seen.ahead(raw, kind.max_vel_x_mps)
        for task in faults:
            if (robot, stack, task) in table.rows:
                continue
            columns = seen.run_fault(task, kind.max_vel_x_mps, drive)
            if columns["ending"] == "not begun":
                raise SimError(
                    f"the robot {robot} never reached its speed; does the guard take {raw} and"
                    f" publish {out}, and does it get /{robot}/odom, /{robot}/scan and /{robot}/tf?"
                )
            _append(table, (robot, stack, task), columns)


def field_summary(rows: Iterable[Row]) -> pd.DataFrame:
    """A row for each robot and stack: goals, minutes of driving to them, contacts, stops."""
    frame = pd.DataFrame(rows)
    frame["is_goal"] = frame.task.str.startswith("goal ")
    found = []
    for (robot, stack), group in frame.groupby(["robot", "stack"], sort=False):
        goals, faults = group[group.is_goal], group[~group.is_goal]
        hours = goals.duration_s.sum() / 3600.0
        found.append({
            "robot": robot, "stack": stack, "n_goals": len(goals),
            "n_arrived": int((goals.ending == "arrived").sum()), "minutes": 60.0 * hours,
            "median_s": goals.duration_s.median(), "largest_s": goals.duration_s.max(),
            **group[[*_CONTACTS]].sum().to_dict(),
            "false_stops": int(goals.false_stops.sum()), "late_stops": int(goals.late_stops.sum()),
            "n_faults": len(faults), "n_stood": int((faults.ending == "stood").sum()),
            "largest_stood_s": faults.stood_s.max(),
        })  # fmt: skip
    return pd.DataFrame(found)
