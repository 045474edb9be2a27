"""Message classes for raw publishers and subscriptions of types that are not installed.

There is no wheel of tf2_msgs, among others, and rclpy takes a type only with its compiled support.
A message that travels as bytes needs no more of that than its name, its hash and that its size is
unbounded, so such a support is made here, for rmw_fastrtps_cpp alone. Its type description, which
the middleware requires, has a name and no fields.

Structures: `rosidl_runtime_c/message_type_support_struct.h` and
`rosidl_typesupport_fastrtps_cpp/message_type_support.h`.
"""

import ctypes
from functools import cache
from typing import Any

from rclpy.utilities import get_rmw_implementation_identifier

from serd_bag.formats.rosbag2.message_types import MessageType

_MIDDLEWARE = "rmw_fastrtps_cpp"
_SUPPORT = b"rosidl_typesupport_fastrtps_c"
_INTROSPECTION = b"rosidl_typesupport_introspection_c"
_HASH_START, _HASH_BYTES = "RIHS01_", 32
_HEADROOM = 1 << 16

_Handle = ctypes.CFUNCTYPE(ctypes.c_void_p, ctypes.c_void_p, ctypes.c_char_p)
_OfSupport = ctypes.CFUNCTYPE(ctypes.c_void_p, ctypes.c_void_p)
_MaximumSize = ctypes.CFUNCTYPE(ctypes.c_size_t, ctypes.POINTER(ctypes.c_char))


def _struct(**fields: Any) -> type[ctypes.Structure]:
    return type("_Struct", (ctypes.Structure,), {"_fields_": list(fields.items())})


_VOID, _TEXT, _SIZE = ctypes.c_void_p, ctypes.c_char_p, ctypes.c_size_t
#: message_type_support_callbacks_t; what converts messages stays empty.
_Callbacks = _struct(
    namespace=_TEXT, name=_TEXT, serialize=_VOID, deserialize=_VOID, size=_VOID,
    maximum_size=_MaximumSize, key=_VOID,
)  # fmt: skip
#: rosidl_typesupport_introspection_c__MessageMembers; none.
_Members = _struct(
    namespace=_TEXT, name=_TEXT, count=ctypes.c_uint32, size=_SIZE, has_key=ctypes.c_bool,
    members=_VOID, initialize=_VOID, finalize=_VOID,
)  # fmt: skip
#: rosidl_message_type_support_t.
_Support = _struct(
    identifier=_TEXT, data=_VOID, handle=_Handle, hash=_OfSupport, description=_OfSupport,
    sources=_OfSupport,
)  # fmt: skip
#: A rosidl sequence, or a string.
_Sequence = _struct(data=_TEXT, size=_SIZE, room=_SIZE)
#: rosidl_runtime_c__type_description__TypeDescription.
_Description = _struct(type_name=_Sequence, fields=_Sequence, others=_Sequence)
#: rosidl_type_hash_t; version 0 where the hash is not known.
_Hash = _struct(version=ctypes.c_uint8, value=ctypes.c_uint8 * _HASH_BYTES)


@cache
def raw_message_class(kind: MessageType) -> Any | None:
    """A class that raw publishers and subscriptions take; None with another middleware.

    Classes live as long as the process, since the middleware keeps pointers into them.
    """
    if get_rmw_implementation_identifier() != _MIDDLEWARE:
        return None
    support, kept = _support(kind)
    members = {"_TYPE_SUPPORT": _capsule(ctypes.addressof(support)), "_kept": kept}
    unused = ("_CREATE_ROS_MESSAGE", "_CONVERT_FROM_PY", "_CONVERT_TO_PY", "_DESTROY_ROS_MESSAGE")
    metaclass = type("RawMetaclass", (type,), {**members, **dict.fromkeys(unused, _refuse)})
    return metaclass(kind.name.rpartition("/")[2], (), {"type_name": kind.name})


def _support(kind: MessageType) -> tuple[Any, tuple[Any, ...]]:
    """The support, and what it points to."""
    text = kind.name.encode()
    *namespace, name = text.split(b"/")
    callbacks = _Callbacks(b"::".join(namespace), name)
    callbacks.maximum_size = _MaximumSize(_unbounded)
    members = _Members(b"__".join(namespace), name)
    described = _Description(type_name=_Sequence(text, len(text), len(text) + 1))
    values = (_hash(kind.type_hash), described, _Sequence())
    supports, addresses = dict[bytes, Any](), dict[bytes, int]()
    handle = _Handle(lambda _, identifier: addresses.get(identifier))
    for identifier, data in ((_SUPPORT, callbacks), (_INTROSPECTION, members)):
        functions = (_returns(each) for each in values)
        supports[identifier] = _Support(identifier, ctypes.addressof(data), handle, *functions)
        addresses[identifier] = ctypes.addressof(supports[identifier])
    return supports[_SUPPORT], (supports, callbacks, members, values)


def _hash(text: str) -> Any:
    try:
        digest = bytes.fromhex(text.removeprefix(_HASH_START))
    except ValueError:
        return _Hash()
    is_known = text.startswith(_HASH_START) and len(digest) == _HASH_BYTES
    return _Hash(1, (ctypes.c_uint8 * _HASH_BYTES)(*digest)) if is_known else _Hash()


def _returns(value: ctypes.Structure) -> Any:
    """A C function of the support that returns the address of the value."""
    address = ctypes.addressof(value)
    return _OfSupport(lambda _: address)


def _unbounded(bounds: Any) -> int:
    bounds[0] = b"\0"
    return _HEADROOM


def _refuse(*_: Any) -> None:
    raise NotImplementedError("messages of this type travel as bytes only; install its package")


def _capsule(address: int) -> Any:
    new = ctypes.pythonapi.PyCapsule_New
    new.restype = ctypes.py_object
    new.argtypes = (ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p)
    return new(address, None, None)
