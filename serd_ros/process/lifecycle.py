"""Brings a managed node up: at once, or as a lifecycle manager asks for it."""

from collections.abc import Callable
from typing import Any

from rclpy.lifecycle.node import LifecycleNodeMixin, LifecycleState
from rclpy.lifecycle.node import TransitionCallbackReturn as _Result

from serd_files.errors import USER_ERRORS
from serd_ros.convert.frames import Frames
from serd_ros.process.serd_node import Activate, Activity, Endpoints, SerdNode
from serd_ros.settings import ManagedConfig


def bring_up(node: SerdNode[Any]) -> "Lifecycle | None":
    """Let a node that can be managed begin to work, or wait for its lifecycle manager.

    Returns None for any other node, which works since it was constructed.
    """
    return Lifecycle(node) if isinstance(node.config, ManagedConfig) else None


class Lifecycle(LifecycleNodeMixin):
    """The states of a managed node; without a manager it is active from the beginning."""

    def __init__(self, node: SerdNode[Any]) -> None:
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
