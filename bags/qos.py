"""Quality of service of a topic, written as rosbag2 of Jazzy (metadata version 9) writes it."""

from dataclasses import dataclass
from typing import Any, Literal

import yaml

_INFINITE = {"sec": 9223372036, "nsec": 854775807}


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
SENSOR_DATA = QosProfile(reliability="best_effort", depth=5)
LATCHED = QosProfile(durability="transient_local", depth=1)


def qos_yaml(profiles: tuple[QosProfile, ...]) -> str:
    """The profiles as the text kept with an MCAP channel."""
    if not profiles:
        return ""
    values = [profile.values() for profile in profiles]
    return yaml.safe_dump(values, sort_keys=False, default_flow_style=False).rstrip("\n")


def qos_of_yaml(text: str) -> QosProfile:
    """The first profile of such a text; ours for topics that carry none or one of another version.

    Older rosbag2 writes reliability, durability and history as the numbers of rmw.
    """
    try:
        profiles = yaml.safe_load(text)
    except yaml.YAMLError:
        return RELIABLE
    if not (isinstance(profiles, list) and profiles and isinstance(profiles[0], dict)):
        return RELIABLE
    first = profiles[0]
    best_effort = first.get("reliability") in ("best_effort", 2)
    latched = first.get("durability") in ("transient_local", 1)
    depth = first.get("depth")
    return QosProfile(
        reliability="best_effort" if best_effort else "reliable",
        durability="transient_local" if latched else "volatile",
        depth=depth if isinstance(depth, int) and depth > 0 else RELIABLE.depth,
    )
