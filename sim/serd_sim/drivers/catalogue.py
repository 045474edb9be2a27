"""Drivers: their interface, and those that commands and tables name; a model file is a name too."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Protocol

from serd_bag.nearest import choice_rule
from serd_core.grid.grid import Action
from serd_sim.drivers.expert import STYLES, ExpertSettings, ScriptedExpert, VariedExpert
from serd_sim.errors import SimError
from serd_sim.scenario.scenario import Scenario
from serd_sim.world.observation import Observation

#: Ends of the name of a driver that is a model file.
MODEL_SUFFIXES = (".yaml", ".yml")


class Driver(Protocol):
    """Chooses an action per decision epoch: a scripted person or a learned policy."""

    @property
    def name(self) -> str:
        """Name for tables."""

    def begin(self, episode: int) -> None:
        """A new episode starts; random choices depend on its number only."""

    def decide(self, observation: Observation, state: int, /) -> Action:
        """The action of the decision epoch that begins now, in a cell; state: -1 off the grid."""


#: An expert that never wavers or waits, so that only the planner is measured.
_RESOLUTE = ExpertSettings(waver_probability=0.0, wait_probability=0.0)
_AGAINST_FLOW = replace(_RESOLUTE, goes_with_flow=False)
_DRIVERS: dict[str, Callable[[Scenario, int], Driver]] = {
    "expert": ScriptedExpert,
    "expert_with_flow": partial(ScriptedExpert, settings=_RESOLUTE),
    "expert_against_flow": partial(ScriptedExpert, settings=_AGAINST_FLOW),
    "varied_expert": VariedExpert,
    **{f"{name}_expert": partial(ScriptedExpert, settings=each) for name, each in STYLES.items()},
}


def driver_names() -> tuple[str, ...]:
    """Names that `make_driver` accepts."""
    return tuple(_DRIVERS)


def make_driver(name: str, scenario: Scenario, seed: int) -> Driver:
    """The driver of that name or model file; SimError with the nearest name when there is none."""
    if name.endswith(MODEL_SUFFIXES):
        # Here, for the names alone need no Bellman solver.
        from serd_sim.drivers.policy_driver import model_driver

        return model_driver(name, scenario, seed)
    if name not in _DRIVERS:
        names = choice_rule("driver", name, _DRIVERS)
        raise SimError(f"{names}; or name the .yaml file of a model")
    return _DRIVERS[name](scenario, seed)
