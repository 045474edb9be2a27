"""What the strategy says of itself: to viewers, on `diagnostics` and in its log."""

from serd_app.navigation.forecast_text import (
    outlook_in_short,
    outlook_values,
    situation_of,
    traps_in_words,
)
from serd_app.navigation.navigator import Navigator
from serd_app.navigation.strategy import Strategy
from serd_ros.convert.diagnostics import OK, WARN
from serd_ros.display.strategy_display import StrategyDisplay
from serd_ros.parameters.configs import StrategyConfig
from serd_ros.process.serd_node import SerdNode
from sim.world.observation import Observation

_SAY_AGAIN_S = 5.0


class StrategyVoice:
    """Speaks for a node; `time_s` is that of the last decision."""

    def __init__(self, node: SerdNode[StrategyConfig]) -> None:
        self.time_s = 0.0
        self._node = node
        self._display = StrategyDisplay(node)

    def tell_plan(self, strategy: Strategy, what: str, began_s: float) -> None:
        """A new plan and its traps; what: why it was made, began_s: wall time when that began."""
        self._display.show_strategy(strategy, self.time_s)
        took_ms = 1e3 * (self._node.wall_s() - began_s)
        self._node.get_logger().info(f"{what}: plan made and shown in {took_ms:.1f} ms")
        if traps := traps_in_words(strategy.traps):
            self._node.get_logger().warning(traps)

    def tell_decision(self, navigator: Navigator, observation: Observation) -> None:
        """What the decision just taken was made on."""
        outlook = navigator.outlook
        assert outlook is not None
        self.time_s = observation.time_s
        self._display.show_outlook(outlook, navigator.way_m(observation))
        needs_look, doing = situation_of(outlook)
        if needs_look:
            self._node.get_logger().warning(
                f"{doing} at ({observation.x_m:.1f}, {observation.y_m:.1f}) m: "
                f"{outlook_in_short(outlook)}",
                throttle_duration_sec=_SAY_AGAIN_S,
            )
        values = outlook_values(outlook, navigator.strategy)
        self._node.report(self.time_s, values, level=WARN if needs_look else OK, message=doing)

    def tell_refusal(self, error: Exception) -> None:
        """A goal or a model that cannot be."""
        self._node.get_logger().warning(f"refused, going on as before: {error}")
        self._node.report(self.time_s, {}, level=WARN, message=f"refused: {error}")

    def tell_give_up(self, reason: str) -> None:
        """The end of a drive that did not arrive."""
        self._node.report(self.time_s, {"reason": reason}, level=WARN, message="gave up")
