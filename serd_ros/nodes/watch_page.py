"""watch_page: shows any running stack on a web page, as a ROS 2 node.

It subscribes and serves the page; it publishes nothing but its own health and drives nothing.
"""

from serd_app.teleop.page.access import PageAccess, read_token
from serd_app.teleop.page.server import PageServer
from serd_app.teleop.page.view import watched_scene_of
from serd_ros.episodes.page_view import LearnedOverlay, WatchView
from serd_ros.process.progress import report_address
from serd_ros.process.serd_node import SerdNode
from serd_ros.settings import WatchPageConfig
from serd_sim.scenario.scenario import load_scenario

_PERIOD_S = 0.05


class WatchPageNode(SerdNode[WatchPageConfig]):
    """Sends what the topics have to all open pages, twenty times a second."""

    config_class = WatchPageConfig

    def __init__(self, kind: str) -> None:
        super().__init__(kind)
        config = self.config
        scenario = load_scenario(config.scenario)
        self._view = WatchView(scenario)
        access = PageAccess(config.address, read_token(config.token_file))
        scene = watched_scene_of(scenario, self._view.grid)
        self._server = PageServer(scene, access, config.port)
        self._view.subscribe(self.endpoints)
        self._overlay = LearnedOverlay(self.endpoints, scenario, self._server)
        self.at_end.callback(self._server.close)
        self.at_end.callback(self._overlay.close)
        self.endpoints.every(_PERIOD_S, self._show)
        report_address(self._server.url, self.get_logger().info)

    def _show(self) -> None:
        self._server.take()  # a page that only watches has nothing to request
        self._overlay.send()
        self._server.show(self._view.watched_state(self.wall_s()))
