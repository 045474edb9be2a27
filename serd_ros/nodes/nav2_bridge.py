"""nav2_bridge: Nav2 drives instead of our local planner; for full ROS installations.

The strategy's `plan` becomes a goal of `navigate_through_poses`, or where that is not offered its
`waypoint` one of `navigate_to_pose`. Both are sent until the robot is in the cell, whatever
tolerance Nav2 has, which is read from its controller server. nav2_msgs comes with ROS, not as a
wheel, so this node imports it when it starts.
"""

from collections.abc import Callable, Sequence
from functools import partial
from importlib import import_module
from typing import Any, Literal

from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Path
from rcl_interfaces.srv import GetParameters
from rclpy.action import ActionClient
from rclpy.parameter import parameter_value_to_python

from serd_app.navigation.nav2_goals import CELL_TOLERANCES, Nav2Goals, Target
from serd_files.settings import setting, setting_of
from serd_ros.convert.diagnostics import OK, WARN
from serd_ros.convert.motion import PlanarPose, from_pose_stamped, to_pose_stamped
from serd_ros.endpoints import qos, topics
from serd_ros.endpoints.robot import LOCALISATIONS
from serd_ros.errors import NodeError
from serd_ros.process.serd_node import Activate, Activity, Endpoints, SerdNode
from serd_ros.settings import LocalisationConfig, ManagedConfig
from serd_sim.episodes.episode import EpisodeSettings
from serd_sim.scenario.scenario import load_scenario

_WATCH_S = 0.5
_LOG_PERIOD_S = 5.0
#: An action server that is offered beside another one is known at most this much later (s).
_OFFERED_WITHIN_S = 1.0
_CONTROLLER_SERVER = "controller_server"
_PLUGINS, _TOLERANCE = "goal_checker_plugins", "xy_goal_tolerance"
THROUGH_POSES, TO_POSE = "through_poses", "to_pose"


class Nav2BridgeConfig(LocalisationConfig, ManagedConfig):
    """Parameters of nav2_bridge."""

    scenario: str = setting_of(EpisodeSettings, "scenario")
    mode: Literal["auto", "to_pose", "through_poses"] = setting(
        "auto",
        "to_pose: send each waypoint; through_poses: send the plan of the strategy; auto: the"
        " second where Nav2 offers it",
    )
    xy_goal_tolerance: float = setting(
        0.25, "of Nav2, where no controller_server states it", unit="m", gt=0
    )
    waypoint_timeout_s: float = setting(1.0, "cancel without waypoints", unit="s", gt=0)


class Nav2BridgeNode(SerdNode[Nav2BridgeConfig]):
    """Sends goals to Nav2 while it is active."""

    config_class = Nav2BridgeConfig

    def __init__(self, kind: str) -> None:
        self._action_clients: dict[str, ActionClient] = {}
        super().__init__(kind)

    def configure(self) -> Activate:
        """Look up the actions."""
        names = {THROUGH_POSES: "NavigateThroughPoses", TO_POSE: "NavigateToPose"}
        modes = [mode for mode in names if self.config.mode in ("auto", mode)]
        kinds = {mode: ros_type("nav2_msgs.action", names[mode]) for mode in modes}
        clients = {mode: self._action_client(kinds[mode], f"navigate_{mode}") for mode in modes}
        goals = {mode: kinds[mode].Goal for mode in modes}
        cell_size_m = load_scenario(self.config.scenario).cell_size_m
        return partial(Nav2Bridge, goals, clients, cell_size_m)

    def _action_client(self, kind: Any, name: str) -> ActionClient:
        """The client of an action, made once and kept while the process lives.

        The events executor drops what it keeps of an action client without Python's lock: where
        one is destroyed while a message waits for it, the process ends by a segmentation fault.
        """
        if name not in self._action_clients:
            self._action_clients[name] = ActionClient(self, kind, name)
        return self._action_clients[name]


class Nav2Bridge(Activity):
    """`waypoint` or `plan` in, one Nav2 goal at a time out; silence stops Nav2.

    goals, clients: types of goals and action clients by mode.
    """

    def __init__(
        self,
        goals: dict[str, Any],
        clients: dict[str, ActionClient],
        cell_size_m: float,
        endpoints: Endpoints,
    ) -> None:
        self._node, self._goals, self._cell_size_m = endpoints.node, goals, cell_size_m
        config = endpoints.node.config
        self._by_mode = {
            mode: Nav2Goals(
                client,
                partial(self._goal_message, mode),
                timeout_s=config.waypoint_timeout_s,
                tolerance_m=config.xy_goal_tolerance,
            )
            for mode, client in clients.items()
        }
        self._mode = next(iter(clients))
        #: Since when there is a server of another mode alone.
        self._other_wall_s: float | None = None
        self._plan: Sequence[PoseStamped] = ()
        if THROUGH_POSES in clients:
            endpoints.subscribe(Path, topics.PLAN, self._on_plan, qos.COMMAND)
        endpoints.subscribe(PoseStamped, topics.WAYPOINT, self._on_waypoint, qos.COMMAND)
        LOCALISATIONS[config.pose_from](endpoints, self._take_pose)
        self._tolerance = Nav2Tolerance(endpoints, self._take_tolerance)
        endpoints.every(_WATCH_S, self._watch)

    def close(self) -> None:
        """Do not leave Nav2 driving."""
        for each in self._by_mode.values():
            each.cancel()

    def _take_pose(self, _: int, pose: PlanarPose) -> None:
        for each in self._by_mode.values():
            each.robot = pose

    def _take_tolerance(self, tolerance_m: float) -> None:
        """Nav2's own; where cells are small beside it, waypoints are reached in several goals."""
        for each in self._by_mode.values():
            each.tolerance_m = tolerance_m
        text = f"{_CONTROLLER_SERVER} has an {_TOLERANCE} of {tolerance_m:g} m"
        self._node.get_logger().info(text)
        if self._cell_size_m < CELL_TOLERANCES * tolerance_m:
            self._node.get_logger().warning(
                f"cells should be at least {CELL_TOLERANCES:g} times as long as {_TOLERANCE}"
                f" ({tolerance_m:g} m), they have {self._cell_size_m:g} m: the robot stops short of"
                f" waypoints; set it to at most {self._cell_size_m / CELL_TOLERANCES:g} m"
            )

    def _choose(self) -> str:
        """The first mode whose server is there; it stays until that one has gone."""
        ready = [mode for mode, goals in self._by_mode.items() if goals.ready]
        if self._mode in ready or not ready:
            self._other_wall_s = None
            return self._mode
        now_s = self._node.wall_s()
        if self._other_wall_s is None:
            self._other_wall_s = now_s
        if now_s - self._other_wall_s > _OFFERED_WITHIN_S:
            self._mode = ready[0]
        return self._mode

    def _on_plan(self, message: Path) -> None:
        """The way from the robot's cell on, to which it need not go back."""
        self._plan = message.poses[1:] or message.poses

    def _on_waypoint(self, message: PoseStamped) -> None:
        """A waypoint is repeated while the strategy drives, a plan is not."""
        mode = self._choose()
        poses = self._plan if mode == THROUGH_POSES else [message]
        stamped = [from_pose_stamped(each, self._node.frames) for each in poses]
        time_ns, _ = from_pose_stamped(message, self._node.frames)
        targets = [pose for _, pose in stamped]
        self._by_mode[mode].take(targets, time_ns * 1e-9, self._node.wall_s())

    def _goal_message(self, mode: str, targets: Sequence[Target], time_s: float) -> Any:
        poses = [to_pose_stamped(target, time_s) for target in targets]
        if mode == THROUGH_POSES:
            return self._goals[mode](poses=poses)
        return self._goals[mode](pose=poses[0])

    def _watch(self) -> None:
        mode = self._choose()
        self._tolerance.look()
        goals = self._by_mode[mode]
        if goals.expire(self._node.wall_s()):
            self._plan = ()  # of a drive that is over
            self._node.get_logger().warning("no waypoint in time: goal of Nav2 cancelled")
        well = goals.state in ("no goal", "sent", "driving", "arrived")
        if not well:
            self._node.get_logger().warning(
                f"navigate_{mode}: {goals.state}", throttle_duration_sec=_LOG_PERIOD_S
            )
        values = {"goal": goals.state, "mode": mode, _TOLERANCE: goals.tolerance_m}
        self._node.report(self._node.now_s(), values, level=OK if well else WARN)


class Nav2Tolerance:
    """Reads the largest tolerance of the goal checkers of Nav2's controller server, once it is
    there, and again where it was away."""

    def __init__(self, endpoints: Endpoints, take: Callable[[float], None]) -> None:
        self._take = take
        self._client = endpoints.client(GetParameters, f"{_CONTROLLER_SERVER}/get_parameters")
        self._guarded = partial(endpoints.guarded, _CONTROLLER_SERVER)
        self._names: list[str] = []
        self._asked: Any = None

    def look(self) -> None:
        """Ask where a server has come."""
        if not self._client.service_is_ready():
            self._asked = None
        elif self._asked is None:
            self._ask([_PLUGINS], self._on_plugins)

    def _ask(self, names: list[str], take: Callable[[Any], None]) -> None:
        self._names = names
        self._asked = self._client.call_async(GetParameters.Request(names=names))
        self._asked.add_done_callback(self._guarded(take))

    def _on_plugins(self, future: Any) -> None:
        plugins = [each for value in self._values(future) for each in value]
        if plugins:
            self._ask([f"{each}.{_TOLERANCE}" for each in plugins], self._on_tolerances)

    def _on_tolerances(self, future: Any) -> None:
        found = [value for value in self._values(future) if isinstance(value, float)]
        if found and max(found) > 0.0:
            self._take(max(found))

    def _values(self, future: Any) -> list[Any]:
        """Those that are set."""
        values = map(parameter_value_to_python, future.result().values)
        return [value for value in values if value is not None]


def ros_type(module: str, name: str) -> Any:
    """A generated type of a full ROS installation; NodeError with the fix where it is missing."""
    try:
        return getattr(import_module(module), name)
    except ImportError:
        package = module.split(".", 1)[0]
        raise NodeError(
            f"nav2_bridge needs the ROS package {package}, which is not installed; run 'apt-get "
            f"install ros-jazzy-{package.replace('_', '-')}', or use the stack goto"
        ) from None
