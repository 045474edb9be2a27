"""The states of a node that a lifecycle manager brings up, where its parameter `managed` is true.

States and transitions are those of https://design.ros2.org/articles/node_lifecycle.html. Without
`managed` the node configures and activates itself at its start, and has no lifecycle services.

An error of the project refuses a transition with its sentence in the log; any other exception is an
internal error, after which the node is unconfigured.
"""

from collections.abc import Callable
from typing import Any

from rclpy.lifecycle.node import LifecycleNodeMixin, LifecycleState
from rclpy.lifecycle.node import TransitionCallbackReturn as _Result

from serd_files.errors import USER_ERRORS
from serd_ros.convert.frames import Frames
from serd_ros.endpoints.endpoints import Endpoints
from serd_ros.process.serd_node import SerdNode
from serd_ros.settings import Config


class Activity:
    """The work of an active node: made at its activation, dropped at its deactivation."""

    def deactivate(self) -> None:
        """End the work; the process goes on, and the endpoints are destroyed afterwards."""
        self.close()

    def close(self) -> None:
        """End the work; the process ends."""


#: Makes endpoints and begins to work.
Activate = Callable[[Endpoints], Activity]


class ManagedNode(SerdNode[Config]):
    """A node that a lifecycle manager can bring up.

    configure: reads and checks files; returns what makes endpoints and begins to work.
    """

    def __init__(self, kind: str) -> None:
        super().__init__(kind)
        self.lifecycle = Lifecycle(self)

    def configure(self) -> Activate:
        """Read and check what the node needs."""
        raise NotImplementedError


class Lifecycle(LifecycleNodeMixin):
    """Brings a node up."""

    def __init__(self, node: ManagedNode[Any]) -> None:
        self.activity, self._node = Activity(), node
        self._activate: Activate | None = None
        self._endpoints: Endpoints | None = None
        node.at_end.callback(self._close)
        if not node.config.managed:
            self._activate = node.configure()
            self._make_activity()
            return
        # What the mixin uses of a node that derives from it.
        self.handle, self._services = node.handle, node._services
        self.default_callback_group = node.default_callback_group
        super().__init__()
        node.guard_services()
        node.get_logger().info("unconfigured: waiting for a lifecycle manager")

    def on_configure(self, _: LifecycleState) -> _Result:
        """Make what the node needs; a refusal leaves it unconfigured."""
        return self._rise("configure", self._configure, self._clean_up)

    def on_activate(self, _: LifecycleState) -> _Result:
        """Begin to work; a refusal leaves the node inactive."""
        return self._rise("activate", self._make_activity, self._drop_activity)

    def on_deactivate(self, _: LifecycleState) -> _Result:
        """End the work; after an error in it the node is unconfigured."""
        return self._fall("deactivate", self.activity.deactivate, self._drop_activity)

    def on_cleanup(self, _: LifecycleState) -> _Result:
        """Free what was configured."""
        return self._fall("cleanup", self._clean_up)

    def on_shutdown(self, _: LifecycleState) -> _Result:
        """End the work and free everything; the process goes on until a signal."""
        return self._fall("shutdown", self._close, self._clean_up)

    def on_error(self, _: LifecycleState) -> _Result:
        """Free everything, so that the node can be configured again."""
        self._clean_up()
        return _Result.SUCCESS

    def _configure(self) -> None:
        self._node.frames = Frames(getattr(self._node.config, "frame_prefix", ""))
        self._activate = self._node.configure()

    def _make_activity(self) -> None:
        assert self._activate is not None
        self._endpoints = self._node.endpoints.scope()
        self.activity = self._activate(self._endpoints)

    def _drop_activity(self) -> None:
        endpoints, self._endpoints, self.activity = self._endpoints, None, Activity()
        if endpoints is not None:
            self._node.endpoints.destroy(endpoints)

    def _clean_up(self) -> None:
        self._drop_activity()
        self._activate = None

    def _close(self) -> None:
        self.activity.close()

    def _rise(
        self, transition: str, make: Callable[[], None], take_back: Callable[[], None]
    ) -> _Result:
        result = self._result_of(transition, make)
        if result == _Result.FAILURE:
            take_back()
        return result

    def _fall(self, transition: str, *steps: Callable[[], None]) -> _Result:
        """Every step is made, whatever those before it did."""
        results = [self._result_of(transition, step) for step in steps]
        is_done = all(each == _Result.SUCCESS for each in results)
        return _Result.SUCCESS if is_done else _Result.ERROR

    def _result_of(self, transition: str, step: Callable[[], None]) -> _Result:
        try:
            step()
        except USER_ERRORS as error:
            self._node.get_logger().error(f"{transition} refused: {error}")
            return _Result.FAILURE
        except Exception as error:
            self._node.callbacks.note(transition, step, error)
            return _Result.ERROR
        return _Result.SUCCESS
