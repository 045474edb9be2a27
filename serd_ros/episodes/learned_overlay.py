"""The newest model of a learner as overlays of the page, solved in a thread beside the node."""

from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

from std_msgs.msg import String

from serd_app.navigation.overlay import ModelOverlay, overlay_of
from serd_app.navigation.strategy import load_strategy
from serd_app.teleop.page.server import PageServer
from serd_app.teleop.page.view import overlay_message
from serd_files.errors import USER_ERRORS
from serd_files.model_file import ModelFile
from serd_files.yaml_config import yaml_model
from serd_ros.endpoints import qos, topics
from serd_ros.process.serd_node import SerdNode
from serd_sim.scenario.scenario import Scenario

_NAME = "model of the learner"


class LearnedOverlay:
    """Models that come while one is solved wait; of these only the newest is solved."""

    def __init__(self, node: SerdNode[Any], scenario: Scenario, server: PageServer) -> None:
        self._node, self._scenario, self._server = node, scenario, server
        self._pool = ThreadPoolExecutor(max_workers=1, thread_name_prefix="overlay")
        self._newest: str | None = None
        self._solved: Future[ModelOverlay] | None = None
        node.create_subscription(String, topics.MODEL, self._take, qos.LATCHED)

    def send(self) -> None:
        """Send what has been solved to the pages and begin with the newest model; never waits."""
        if self._solved is not None and self._solved.done():
            solved, self._solved = self._solved, None
            try:
                self._server.show_overlay(overlay_message(solved.result()))
            except USER_ERRORS as error:
                self._node.get_logger().warning(f"no overlay: {error}")
        if self._solved is None and self._newest is not None:
            text, self._newest = self._newest, None
            self._solved = self._pool.submit(_solve, text, self._scenario)

    def close(self) -> None:
        """Wait for the model that is being solved."""
        self._pool.shutdown(cancel_futures=True)

    def _take(self, message: String) -> None:
        self._newest = message.data


def _solve(text: str, scenario: Scenario) -> ModelOverlay:
    file = yaml_model(text, ModelFile, name=_NAME)
    return overlay_of(load_strategy(_NAME, scenario, "optimal", file=file))
