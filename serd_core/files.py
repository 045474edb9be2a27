"""Records of the package as files: NumPy's npz with one JSON text for the structure.

A file has what the record's fields hold: arrays, numbers, texts and further records. Nothing in it
is executed on reading: classes are named, and only dataclasses of this package are made again.
"""

import dataclasses
import importlib
import io
import json
import zipfile
import zlib
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np
import scipy  # loads sparse at its first use
from numpy.typing import NDArray

from serd_core.errors import SerdError

FORMAT = "serd-core 1"
_PACKAGE = "serd_core."
#: What reading a damaged or made-up file raises.
_UNREADABLE = (
    *(ValueError, LookupError, TypeError, AttributeError, RuntimeError, MemoryError),
    *(EOFError, OSError, zipfile.BadZipFile, zlib.error),
)


def save(path: str | Path, record: Any) -> None:
    """Write a problem, decisions, a fit or another record of this package.

    A SparseModel with functions of the user's own cannot be written.
    """
    arrays: dict[str, NDArray[Any]] = {}
    text = json.dumps({"format": FORMAT, "record": _encoded(record, arrays, type(record).__name__)})
    target = Path(path)
    whole = target.with_name(target.name + ".part")
    try:
        with whole.open("wb") as file:
            np.savez_compressed(file, allow_pickle=False, structure=np.array(text), **arrays)
        whole.replace(target)
    finally:
        whole.unlink(missing_ok=True)


def load(path: str | Path) -> Any:
    """The record of a file that `save` wrote; SerdError where it is no such file."""
    whole = io.BytesIO(Path(path).read_bytes())
    try:
        with np.load(whole, allow_pickle=False) as found:
            content = json.loads(str(found["structure"]))
            arrays = {name: found[name] for name in found.files}
            if content["format"] == FORMAT:
                return _decoded(content["record"], arrays)
    except _UNREADABLE as error:
        if isinstance(error, SerdError):
            raise
        raise SerdError(f"{path} must be a file written by save, got: {error}") from error
    raise SerdError(f"{path} must have the format {FORMAT!r}, got {content['format']!r}")


def _encoded(value: Any, arrays: dict[str, NDArray[Any]], name: str) -> Any:
    if value is None or isinstance(value, bool | int | float | str):
        return value.value if isinstance(value, Enum) else value
    if isinstance(value, np.ndarray | np.generic) and np.asarray(value).dtype != object:
        key = f"array{len(arrays)}"
        arrays[key] = np.asarray(value)
        return {"array": key}
    if isinstance(value, scipy.sparse.csr_array | scipy.sparse.csc_array):
        parts = (value.data, value.indices, value.indptr, value.shape)
        return {"sparse": value.format, "parts": _encoded(parts, arrays, name)}
    if isinstance(value, tuple | list):
        return {"tuple": [_encoded(each, arrays, f"{name}[{i}]") for i, each in enumerate(value)]}
    kind = type(value)
    if isinstance(value, Enum) and kind.__module__.startswith(_PACKAGE):
        return {"enum": f"{kind.__module__}:{kind.__name__}", "value": value.value}
    if dataclasses.is_dataclass(value) and kind.__module__.startswith(_PACKAGE):
        fields = {
            each.name: _encoded(getattr(value, each.name), arrays, f"{name}.{each.name}")
            for each in dataclasses.fields(value)
            if each.init and not each.name.startswith("_")  # these keep what was computed
        }
        return {"class": f"{kind.__module__}:{kind.__name__}", "fields": fields}
    raise SerdError(
        f"{name} must be an array, a number, a text or a record of serd_core to be saved, got"
        f" {kind.__name__}; save its parameters and build it again"
    )


def _decoded(value: Any, arrays: dict[str, NDArray[Any]]) -> Any:
    if not isinstance(value, dict):
        return value
    if "array" in value:
        return arrays[value["array"]]
    if "tuple" in value:
        return tuple(_decoded(each, arrays) for each in value["tuple"])
    if "sparse" in value:
        *parts, shape = _decoded(value["parts"], arrays)
        kind = scipy.sparse.csr_array if value["sparse"] == "csr" else scipy.sparse.csc_array
        return kind(tuple(parts), shape=shape)
    if "enum" in value:
        return _class(value["enum"])(value["value"])
    kind = _class(value["class"])
    return kind(**{name: _decoded(each, arrays) for name, each in value["fields"].items()})


def _class(place: str) -> Any:
    module, _, name = place.partition(":")
    found = None
    if module.startswith(_PACKAGE):
        try:
            found = getattr(importlib.import_module(module), name, None)
        except ImportError:
            found = None
    is_known = isinstance(found, type) and found.__module__ == module
    if not (is_known and (dataclasses.is_dataclass(found) or issubclass(found, Enum))):  # type: ignore[arg-type]
        raise SerdError(
            f"a saved record must be of a class of serd_core, got {place!r}; use the version that"
            " wrote the file"
        )
    return found
