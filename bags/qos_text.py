"""Quality of service out of the YAML text of a bag: names since Jazzy, numbers before."""

from typing import Any, Literal

import yaml

from bags.qos import QosProfile

_HISTORY: dict[Any, Literal["keep_last", "keep_all"]] = {
    1: "keep_last",
    2: "keep_all",
    "keep_last": "keep_last",
    "keep_all": "keep_all",
}


def qos_of_text(text: str) -> tuple[QosProfile, ...]:
    """The profiles, unknown values at their default; none where the text is no list of them."""
    try:
        values = yaml.safe_load(text) if text else []
    except yaml.YAMLError:
        return ()
    if not isinstance(values, list):
        return ()
    return tuple(_profile(value) for value in values if isinstance(value, dict))


def _profile(value: dict[str, Any]) -> QosProfile:
    best_effort = value.get("reliability") in (2, "best_effort")
    latched = value.get("durability") in (1, "transient_local")
    depth = value.get("depth")
    return QosProfile(
        reliability="best_effort" if best_effort else "reliable",
        durability="transient_local" if latched else "volatile",
        history=_HISTORY.get(value.get("history"), "unknown"),
        depth=depth if isinstance(depth, int) else 0,
    )
