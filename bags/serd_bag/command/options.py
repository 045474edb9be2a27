"""The commands of `serd-bag`, their options and what they do; `serd bag` makes its own of them."""

import math
from pathlib import Path
from typing import Any

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
        "Sound MCAP files are not read but for their summaries. Other and damaged ones are read"
        " too, and their faults are listed.",
    ),
    "check": ("require json", "read bags completely and list their faults", ""),
    "convert": (
        "output compression json",
        "write a sound bag as MCAP of ROS 2, BAG_mcap",
        "Messages of ROS 1 become those of ROS 2 with the same fields, all others stay as they"
        " are.",
    ),
    "cut": (
        "output topic without from_s to_s split_mb sort compression json",
        "write a part of a bag as a new bag, BAG_cut",
        "",
    ),
    "merge": (
        "output topic without from_s to_s split_mb sort compression json",
        "write several bags as one, by log time, BAG_merged",
        "",
    ),
    "cat": ("topic without from_s to_s columns", "print messages as JSON lines, or as CSV", ""),
    "diff": (
        "json",
        "compare two bags: messages, types and quality of service of each topic",
        "",
    ),
    "reindex": ("json", "write summaries and metadata.yaml anew, in place", ""),
}
#: Commands that do not take any number of bags.
N_BAGS = {"cat": 1, "diff": 2}
BAGS = "bag folder, or .mcap, .db3 or .bag file; - for standard input"
_REGEX: dict[str, Any] = {"action": "append", "metavar": "REGEX"}
_FLAG: dict[str, Any] = {"action": "store_true"}
#: How argparse reads each option, with its help.
OPTIONS: dict[str, dict[str, Any]] = {
    "output": {
        "type": Path,
        "metavar": "FOLDER",
        "help": "folder of the new bag, which must be empty or not exist; - for standard output",
    },
    "json": {**_FLAG, "help": "print JSON instead of text"},
    "verified_only": {
        **_FLAG,
        "help": "leave out what a damaged part seems to hold, and no checksum vouches for",
    },
    "sizes": {**_FLAG, "help": "read the bags for the bytes of each topic"},
    "require": {
        "action": "append",
        "metavar": "TOPIC",
        "help": "topic that must have messages: /whole/name, or name in any namespace; repeat",
    },
    "compression": {
        "choices": ("none", "zstd"),
        "default": "none",
        "help": "compression of the new bag",
    },
    "topic": {**_REGEX, "help": "take topics of which this matches the whole name; repeat"},
    "without": {**_REGEX, "help": "leave out topics of which this matches the whole name; repeat"},
    "from_s": {
        "type": float,
        "default": -math.inf,
        "metavar": "S",
        "help": "take messages from this time on, after the first one or of the clock (s)",
    },
    "to_s": {
        "type": float,
        "default": math.inf,
        "metavar": "S",
        "help": "take messages before this time (s)",
    },
    "split_mb": {
        "type": float,
        "metavar": "MB",
        "help": "size at which the next file is started",
    },
    "sort": {**_FLAG, "help": "sort by log time"},
    "columns": {
        "metavar": "FIELDS",
        "help": "print CSV with these fields, as pose.position.x,pose.position.y",
    },
}


def flag_of(option: str) -> str:
    """How an option is written: `from_s` as --from."""
    return f"--{option.removesuffix('_s').replace('_', '-')}"
