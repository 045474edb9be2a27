"""Drivers: their interface, and those that commands and tables name; a model file is a name too."""

from collections.abc import Callable
from functools import partial
from typing import Protocol

from serd_core.grid.grid import Action
from sim.drivers.expert import ExpertSettings, ScriptedExpert
from sim.drivers.expert_styles import STYLES, VariedExpert
from sim.errors import SimError
from sim.scenario.scenario import Scenario
from sim.world.observation import Observation
from storage.nearest import choice_rule

#: Ends of the name of a driver that is a model file.
MODEL_SUFFIXES = (".yaml", ".yml")


class Driver(Protocol):
    """Chooses an action per decision period: a scripted person or a learned policy."""

    @property
    def name(self) -> str:
        """Name for tables."""
        ...

    def begin(self, episode: int) -> None:
        """A new episode starts; random choices depend on its number only."""
        ...

    def decide(self, observation: Observation) -> Action:
        """The action of the decision period that begins now."""
        ...


def _expert(scenario: Scenario, seed: int) -> Driver:
    return ScriptedExpert(scenario, seed)


def _with_flow(scenario: Scenario, seed: int) -> Driver:
    return ScriptedExpert(scenario, seed, _resolute(goes_with_flow=True))


def _against_flow(scenario: Scenario, seed: int) -> Driver:
    return ScriptedExpert(scenario, seed, _resolute(goes_with_flow=False))


def _in_style(scenario: Scenario, seed: int, *, style: str) -> Driver:
    return ScriptedExpert(scenario, seed, STYLES[style])


def _resolute(*, goes_with_flow: bool) -> ExpertSettings:
    """An expert that never wavers or waits, so that only the planner is measured."""
    return ExpertSettings(
        waver_probability=0.0, wait_probability=0.0, goes_with_flow=goes_with_flow
    )


_DRIVERS: dict[str, Callable[[Scenario, int], Driver]] = {
    "expert": _expert,
    "expert_with_flow": _with_flow,
    "expert_against_flow": _against_flow,
    "varied_expert": VariedExpert,
    **{f"{style}_expert": partial(_in_style, style=style) for style in STYLES},
}


def driver_names() -> tuple[str, ...]:
    """Names that `make_driver` accepts."""
    return tuple(_DRIVERS)


def make_driver(name: str, scenario: Scenario, seed: int) -> Driver:
    """The driver of that name or model file; SimError with the nearest name when there is none."""
    if name.endswith(MODEL_SUFFIXES):
        # Here, for the names alone need no Bellman solver.
        from sim.drivers.policy_driver import model_driver

        return model_driver(name, scenario, seed)
    if name not in _DRIVERS:
        names = choice_rule("driver", name, _DRIVERS)
        raise SimError(f"{names}; or name the .yaml file of a model")
    return _DRIVERS[name](scenario, seed)
