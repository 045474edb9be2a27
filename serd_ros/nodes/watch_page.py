"""watch_page: shows any running stack on a web page, as a ROS 2 node.

It subscribes and serves the page; it publishes nothing but its own health and drives nothing.
"""

from serd_app.teleop.page.view import watched_scene_of
from serd_ros.episodes.page_view import WatchView, serve_page
from serd_ros.process.serd_node import SerdNode
from serd_ros.settings import WatchPageConfig
from serd_sim.scenario.scenario import load_scenario

_PERIOD_S = 0.05


class WatchPageNode(SerdNode[WatchPageConfig]):
    """Sends what the topics have to all open pages, twenty times a second."""

    config_class = WatchPageConfig

    def __init__(self, kind: str) -> None:
        super().__init__(kind)
        scenario = load_scenario(self.config.scenario)
        self._view = WatchView(scenario)
        self._view.subscribe(self.endpoints)
        scene = watched_scene_of(scenario, self._view.grid)
        self._server, self._overlay = serve_page(self, scene, scenario)
        self.endpoints.every(_PERIOD_S, self._show)

    def _show(self) -> None:
        self._server.take()  # a page that only watches has nothing to request
        self._overlay.send()
        self._server.show(self._view.watched_state(self.wall_s()))
