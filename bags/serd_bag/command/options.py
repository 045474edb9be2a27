"""The commands of `serd-bag`, their options and what they do; `serd bag` makes its own of them."""

import math
from pathlib import Path
from typing import Any

_COPYING = "output topic without from_s to_s split_mb sort compression json"
#: Options of each command, first line and rest of its help.
COMMANDS = {
    "rescue": (
        "output verified_only json",
        "save every whole message of a broken recording, or of any bytes, in BAG_rescued",
        "The new bag has a certificate of what was lost. The broken one is not changed.",
    ),
    "info": (
        "sizes json",
        "show what bags hold",
        "Of sound files only summaries and indexes are read. Other files are read completely, and"
        " their faults are listed.",
    ),
    "check": ("require json", "read bags completely and list their faults", ""),
    "convert": (
        "output compression json",
        "write a sound bag as MCAP of ROS 2, BAG_mcap",
        "Messages of ROS 1 become those of ROS 2 with the same fields, all others stay as they"
        " are.",
    ),
    "fix-clock": (
        "output json",
        "correct the stamps of senders whose clocks are wrong, in BAG_fixed",
        "check names these senders. original_stamps.csv in the new bag has the stamps as they were."
        " Where no clock is wrong, nothing is written.",
    ),
    "cut": (_COPYING, "write a part of a bag as a new bag, BAG_cut", ""),
    "merge": (_COPYING, "write several bags as one, by log time, BAG_merged", ""),
    "cat": ("topic without from_s to_s columns", "print messages as JSON lines, or as CSV", ""),
    "diff": ("json", "compare messages, types and quality of service of two bags by topic", ""),
    "reindex": ("json", "write summaries and metadata.yaml anew, in place", ""),
}
#: Commands that do not take any number of bags.
N_BAGS = {"cat": 1, "diff": 2}
BAGS = "bag folder, or .mcap, .db3 or .bag file; - for standard input"


def _flag(about: str) -> dict[str, Any]:
    return {"action": "store_true", "help": about}


def _value(metavar: str, about: str, **more: Any) -> dict[str, Any]:
    return {"metavar": metavar, "help": about, **more}


def _several(metavar: str, about: str) -> dict[str, Any]:
    return _value(metavar, f"{about}; repeat", action="append")


_OUTPUT = "folder of the new bag, which must be empty or not exist; - for standard output"
_VERIFIED = "leave out what a damaged part seems to hold, and no checksum vouches for"
_REQUIRE = "topic that must have messages: /whole/name, or name in any namespace"
_FROM = "take messages from this time on, after the first one or of the clock (s)"
_COLUMNS = "print CSV with these fields, as pose.position.x,pose.position.y"
#: How argparse reads each option, with its help.
OPTIONS: dict[str, dict[str, Any]] = {
    "output": _value("FOLDER", _OUTPUT, type=Path),
    "json": _flag("print JSON instead of text"),
    "verified_only": _flag(_VERIFIED),
    "sizes": _flag("read the bags for the bytes of each topic"),
    "require": _several("TOPIC", _REQUIRE),
    "compression": {"choices": ("none", "zstd"), "default": "none", "help": "of the new bag"},
    "topic": _several("REGEX", "take topics of which this matches the whole name"),
    "without": _several("REGEX", "leave out topics of which this matches the whole name"),
    "from_s": _value("S", _FROM, type=float, default=-math.inf),
    "to_s": _value("S", "take messages before this time (s)", type=float, default=math.inf),
    "split_mb": _value("MB", "size at which the next file is started", type=float),
    "sort": _flag("sort by log time"),
    "columns": _value("FIELDS", _COLUMNS),
}


def flags_of(option: str) -> tuple[str, ...]:
    """How an option is written: `from_s` as --from."""
    flag = f"--{option.removesuffix('_s').replace('_', '-')}"
    return (flag, "-o") if option == "output" else (flag,)
