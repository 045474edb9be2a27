"""Message types as rosbag2 stores them: definition text with all dependencies, and type hash.

The text is the .msg file followed, depth first and in alphabetical order, by those of the types it
uses, each below a line of 80 `=` and a line `MSG: package/Type`. Dependencies and hash (REP 2016,
RIHS01) are in the .json file beside it. A sourced ROS installation names its folders in
AMENT_PREFIX_PATH; the wheels from PyPI install into the prefix of the Python environment. Types
that are not installed come from the type store of rosbags.
"""

import json
import os
import re
import sys
from dataclasses import replace
from functools import cache, lru_cache
from pathlib import Path

from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore
from rosbags.typesys.msg import normalize_msgtype
from rosbags.typesys.store import Typestore

from serd_bag.errors import BagError
from serd_bag.nearest import hint
from serd_bag.topic import ROS1MSG, ROS2IDL, ROS2MSG, MessageType, Topic

_SEPARATOR = "=" * 80
#: Characters of a definition without comments: rosbags takes a second for 10,000.
_LONGEST_FIELDS = 20_000
_ADDED = Path(__file__).with_name("added_types.msg")
_IDL_HEAD = re.compile(rf"^{_SEPARATOR}\nIDL: .*$", re.M)
_TYPE_NAME = re.compile(r"\w+/msg/\w+")


@lru_cache(maxsize=256)
def message_type(name: str) -> MessageType:
    """The message type of that name; BagError names the nearest one where it is unknown."""
    if not _TYPE_NAME.fullmatch(name):
        raise BagError(f"message type must be written package/msg/Type, got {name!r}")
    interface = _interface_file(name, ".json")
    if interface is None:
        return _type_of_rosbags(name)
    values = json.loads(interface.read_text("utf-8"))
    description = values["type_description_msg"]
    fields_of = {
        each["type_name"]: each["fields"]
        for each in (description["type_description"], *description["referenced_type_descriptions"])
    }
    used: list[str] = [name]

    def collect_dependencies(of: str) -> None:
        """Append the types that a type uses, depth first and in alphabetical order, each once."""
        for each in sorted({field["type"]["nested_type_name"] for field in fields_of[of]} - {""}):
            if each not in used:
                used.append(each)
                collect_dependencies(each)

    collect_dependencies(name)
    files = [_interface_file(each, ".msg") for each in used]
    parts = [f"\n{_SEPARATOR}\nMSG: {each.replace('/msg/', '/')}\n" for each in used]
    texts = [file.read_text("utf-8") for file in files if file is not None]
    if len(texts) < len(files):
        return _type_of_rosbags(name)
    text = texts[0] + "".join(map("".join, zip(parts[1:], texts[1:], strict=True)))
    hashes = {each["type_name"]: str(each["hash_string"]) for each in values["type_hashes"]}
    return MessageType(name, text, hashes[name])


def resolve_type(recorded: MessageType) -> MessageType:
    """Text and hash of a recorded type; BagError where neither bag nor installation has them."""
    if recorded.text and recorded.encoding in (ROS2MSG, ROS2IDL, ROS1MSG):
        return replace(recorded, type_hash=recorded.type_hash or _computed_hash(recorded))
    installed = message_type(recorded.name)
    if recorded.type_hash not in ("", installed.type_hash):
        raise BagError(
            f"message type {recorded.name!r} is installed in another version than the recorded one;"
            " install the version that was recorded"
        )
    return installed


def resolve_type_if_known(recorded: MessageType) -> MessageType:
    """The resolved type, or the recorded one where it cannot be resolved."""
    try:
        return resolve_type(recorded)
    except BagError:
        return recorded if recorded.text else replace(recorded, encoding="")


def share_folders() -> tuple[Path, ...]:
    """Existing `share` folders, the sourced installation first."""
    prefixes = [part for part in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if part]
    folders = (Path(prefix) / "share" for prefix in (*prefixes, sys.prefix))
    return tuple(folder for folder in dict.fromkeys(folders) if folder.is_dir())


@cache
def rosbags_types() -> Typestore:
    """The message types of ROS 2 Jazzy that rosbags includes, and the added ones."""
    store = get_typestore(Stores.ROS2_JAZZY)
    for name, text in added_types().items():
        store.register(get_types_from_msg(text, name))
    return store


def added_types() -> dict[str, str]:
    """Definitions of types that rosbags does not have, by name."""
    texts = _ADDED.read_text("utf-8").split(f"{_SEPARATOR}\nMSG: ")[1:]
    return {
        name.replace("/", "/msg/"): text
        for name, _, text in (each.partition("\n") for each in texts)
    }


def typestore_of(definition: MessageType) -> Typestore:
    """A type store with the type and its dependencies; what rosbags raises for a wrong text."""
    store = get_typestore(Stores.EMPTY)
    if definition.encoding == ROS2IDL:
        for text in _IDL_HEAD.split(definition.text):
            store.register(get_types_from_idl(text) if text.strip() else {})
    else:
        store.register(get_types_from_msg(definition.text, normalize_msgtype(definition.name)))
    return store


@lru_cache(maxsize=32)
def store_of(topic: Topic) -> Typestore:
    """The types of a topic: as recorded, else as installed; BagError where there are none."""
    recorded = topic.message_type
    try:
        return typestore_of(resolve_type(recorded))
    except BagError as error:
        raise BagError(f"{topic.name}: the bag has no message definitions; {error}") from None
    except Exception as error:  # a recorded text may be anything
        raise BagError(
            f"{topic.name}: the definition of {recorded.name} in the bag must be that of a message,"
            f" got {type(error).__name__}; name another topic in the mapping"
        ) from None


def _interface_file(name: str, suffix: str) -> Path | None:
    """The file of a type, `share/<package>/msg/<Type><suffix>`, in the first folder that has it."""
    files = (folder / f"{name}{suffix}" for folder in share_folders())
    return next((path for path in files if path.is_file()), None)


def _type_of_rosbags(name: str) -> MessageType:
    store = rosbags_types()
    if name not in store.fielddefs:
        raise BagError(f"message type {name!r} is not installed; {_fix(name)}")
    return MessageType(name, store.generate_msgdef(name, ros_version=2)[0], store.hash_rihs01(name))


def _computed_hash(recorded: MessageType) -> str:
    """RIHS01 of a definition recorded without (rosbag2 before Jazzy); empty if it lacks a part."""
    lines = (line.strip() for line in recorded.text.splitlines())
    fields = "\n".join(line for line in lines if line and not line.startswith("#"))
    if len(fields) > _LONGEST_FIELDS:
        return ""
    try:
        return typestore_of(replace(recorded, text=fields)).hash_rihs01(recorded.name)
    except Exception:  # a recorded text may be anything
        return ""


def _fix(name: str) -> str:
    """The nearest type of the package; else to install the package."""
    package = name.partition("/")[0]
    known = {*rosbags_types().fielddefs}
    for folder in share_folders():
        known.update(f"{package}/msg/{path.stem}" for path in folder.glob(f"{package}/msg/*.msg"))
    types = [each for each in known if each.startswith(f"{package}/")]
    return hint(name, types) if types else f"install the package {package}"
