"""Message types as rosbag2 stores them: definition text with all it refers to, and type hash.

The text is the .msg file followed, depth first and in alphabetical order, by those of the types it
uses, each below a line of 80 `=` and a line `MSG: package/Type`. The hash (REP 2016, RIHS01) stands
in the .json file beside it. Types that are not installed come from the list rosbags carries.
"""

import json
import re
from dataclasses import dataclass
from difflib import get_close_matches
from functools import cache, lru_cache
from pathlib import Path

from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

from bags.errors import BagError
from bags.rosbag2.share_folders import interface_file, share_folders
from storage.nearest import hint

ENCODING = "ros2msg"
_SEPARATOR = "=" * 80
_SAME_PACKAGE = 0.85
_TYPE_NAME = re.compile(r"(\w+)/msg/(\w+)")
_FIELD_TYPE = re.compile(r"^\s*([A-Za-z]\w*(?:/\w+)*)(?:<=\d+)?(?:\[[^\]]*\])?\s+[A-Za-z]", re.M)
_PRIMITIVE = re.compile(r"bool|byte|char|wchar|w?string|float(32|64)|u?int(8|16|32|64)")


@dataclass(frozen=True)
class MessageType:
    """name: as `geometry_msgs/msg/Twist`; text: definition with dependencies; type_hash: RIHS01.

    encoding: how the text is written, `ros2msg` or `ros2idl`, empty where there is no text.
    """

    name: str
    text: str
    type_hash: str
    encoding: str = ENCODING


@lru_cache(maxsize=256)
def message_type(name: str) -> MessageType:
    """The installed message type of that name; BagError names the nearest one where unknown."""
    match = _TYPE_NAME.fullmatch(name)
    if match is None:
        raise BagError(f"message type must be written package/msg/Type, got {name!r}")
    package, short = match.groups()
    text_file = interface_file(package, short, ".msg")
    hash_file = interface_file(package, short, ".json")
    if text_file is None or hash_file is None:
        return _carried_type(name)
    return MessageType(name, _full_text(package, short, {name}), _type_hash(hash_file, name))


def known_types() -> tuple[str, ...]:
    """Names of all installed message types and of those rosbags carries."""
    installed = (
        f"{path.parts[-3]}/msg/{path.stem}"
        for folder in share_folders()
        for path in folder.glob("*/msg/*.msg")
    )
    return tuple(sorted({*installed, *_carried().fielddefs}))


def _full_text(package: str, short: str, seen: set[str]) -> str:
    path = interface_file(package, short, ".msg")
    if path is None:
        raise BagError(
            f"message definition of {package}/{short} must be installed, got none in "
            f"{', '.join(map(str, share_folders()))}; install the package {package}"
        )
    text = path.read_text("utf-8")
    parts = [text]
    for used_package, used in _dependencies(text, package):
        if f"{used_package}/msg/{used}" not in seen:
            seen.add(f"{used_package}/msg/{used}")
            header = f"\n{_SEPARATOR}\nMSG: {used_package}/{used}\n"
            parts.append(header + _full_text(used_package, used, seen))
    return "".join(parts)


def _dependencies(text: str, package: str) -> list[tuple[str, str]]:
    names = {name for name in _FIELD_TYPE.findall(text) if not _PRIMITIVE.fullmatch(name)}
    pairs = (name.split("/") for name in names)
    return sorted((pair[0] if len(pair) > 1 else package, pair[-1]) for pair in pairs)


def _type_hash(path: Path, name: str) -> str:
    entries = json.loads(path.read_text("utf-8"))["type_hashes"]
    return next(str(each["hash_string"]) for each in entries if each["type_name"] == name)


@cache
def _carried() -> Typestore:
    return get_typestore(Stores.ROS2_JAZZY)


def _carried_type(name: str) -> MessageType:
    store = _carried()
    if name not in store.fielddefs:
        raise BagError(f"message type {name!r} is not installed; {_fix(name)}")
    return MessageType(name, store.generate_msgdef(name, ros_version=2)[0], store.hash_rihs01(name))


def _fix(name: str) -> str:
    """The nearest type of a package of that name or nearly so; else the package is missing.

    Names of all packages end much alike, so types of other packages would be no help.
    """
    package, _, _ = name.partition("/")
    packages = {known.partition("/")[0] for known in known_types()}
    close = get_close_matches(package, packages, n=1, cutoff=_SAME_PACKAGE)
    if not close:
        return f"install the package {package}"
    types = [known for known in known_types() if known.startswith(f"{close[0]}/")]
    return hint(f"{close[0]}/{name.partition('/')[2]}", types)
