"""Quality of service of a topic, written as rosbag2 of Jazzy (metadata version 9) writes it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, Literal

from serd_bag.errors import BagError
from serd_bag.formats.limits import yaml_text, yaml_values

_INFINITE = {"sec": 9223372036, "nsec": 854775807}
#: Names of the numbers of rmw.
_NAMES = {
    "history": ("system_default", "keep_last", "keep_all", "unknown"),
    "reliability": ("system_default", "reliable", "best_effort", "unknown", "best_available"),
    "durability": ("system_default", "transient_local", "volatile", "unknown", "best_available"),
    "liveliness": ("system_default", "automatic", "unknown", "manual_by_topic"),
}


@dataclass(frozen=True)
class QosProfile:
    """What a publisher offers; deadlines, lifespans and leases are infinite."""

    reliability: Literal["reliable", "best_effort"] = "reliable"
    durability: Literal["volatile", "transient_local"] = "volatile"
    history: Literal["keep_last", "keep_all", "unknown"] = "keep_last"
    depth: int = 10

    def values(self) -> dict[str, Any]:
        """Keys and values in the order of rosbag2."""
        return {
            "history": self.history,
            "depth": self.depth,
            "reliability": self.reliability,
            "durability": self.durability,
            "deadline": dict(_INFINITE),
            "lifespan": dict(_INFINITE),
            "liveliness": "automatic",
            "liveliness_lease_duration": dict(_INFINITE),
            "avoid_ros_namespace_conventions": False,
        }


RELIABLE = QosProfile()


def qos_text(profiles: Sequence[QosProfile]) -> str:
    """YAML text of the profiles, as rosbag2 writes it into an MCAP channel."""
    if not profiles:
        return ""
    values = [profile.values() for profile in profiles]
    return yaml_text(values).rstrip("\n")


def qos_of_text(text: str) -> tuple[QosProfile, ...]:
    """The profiles in such a text; none where it is no list of profiles.

    Unknown values become the defaults. Older rosbag2 writes the numbers of rmw.
    """
    return tuple(map(_profile, _profiles(text)))


def qos_values(text: str) -> list[dict[str, Any]]:
    """The profiles in such a text as metadata.yaml of Jazzy has them: with names for numbers, all
    other values as they are."""
    return [
        {**RELIABLE.values(), **{key: _named(key, value) for key, value in profile.items()}}
        for profile in _profiles(text)
    ]


@lru_cache(maxsize=256)
def _profiles(text: str) -> tuple[dict[str, Any], ...]:
    try:
        profiles = yaml_values(text) if text else ()
    except BagError:
        return ()
    values = profiles if isinstance(profiles, list) else []
    return tuple(value for value in values if isinstance(value, dict))


def _named(key: str, value: Any) -> Any:
    names = _NAMES.get(key)
    if names is None or not isinstance(value, int):
        return value
    return names[value] if 0 <= value < len(names) else "unknown"


def profile_to_offer(recorded: Sequence[QosProfile]) -> QosProfile:
    """What to offer for a recorded topic: its first profile, reliable where it has none."""
    first = next(iter(recorded), RELIABLE)
    return replace(first, history="keep_last", depth=first.depth or RELIABLE.depth)


def _profile(value: dict[str, Any]) -> QosProfile:
    history, depth = value.get("history"), value.get("depth")
    best_effort = value.get("reliability") in (2, "best_effort")
    latched = value.get("durability") in (1, "transient_local")
    keeps_all: Literal["keep_all", "unknown"] = (
        "keep_all" if history in (2, "keep_all") else "unknown"
    )
    return QosProfile(
        reliability="best_effort" if best_effort else "reliable",
        durability="transient_local" if latched else "volatile",
        history="keep_last" if history in (1, "keep_last") else keeps_all,
        depth=depth if isinstance(depth, int) and depth > 0 else 0,
    )
