"""Which keys a pydantic model allows at a place inside it."""

from collections.abc import Iterator, Sequence
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin

from pydantic import BaseModel


def keys_at(model_class: type[BaseModel], place: Sequence[int | str]) -> tuple[str, ...]:
    """Names of the fields allowed at `place`, a path of keys and indices from the root."""
    found: list[Any] = [model_class]
    for step in place:
        found = [inner for each in found for inner in _inside(each, step)] or found
    models = [each for annotation in found for each in _models(annotation)]
    return tuple(sorted({_key(name, each) for each in models for name in each.model_fields}))


def _inside(annotation: Any, step: int | str) -> Iterator[Any]:
    for each in _alternatives(annotation):
        if _is_model(each):
            if step in each.model_fields:
                yield each.model_fields[step].annotation
        elif get_origin(each) is dict:
            yield get_args(each)[1]
        elif isinstance(step, int):
            yield from (part for part in get_args(each) if part is not Ellipsis)


def _models(annotation: Any) -> Iterator[type[BaseModel]]:
    return (each for each in _alternatives(annotation) if _is_model(each))


def _alternatives(annotation: Any) -> Iterator[Any]:
    origin = get_origin(annotation)
    if origin is Annotated:
        yield from _alternatives(get_args(annotation)[0])
    elif origin in (Union, UnionType):
        for part in get_args(annotation):
            yield from _alternatives(part)
    else:
        yield annotation


def _is_model(annotation: Any) -> bool:
    return isinstance(annotation, type) and issubclass(annotation, BaseModel)


def _key(name: str, model_class: type[BaseModel]) -> str:
    return model_class.model_fields[name].alias or name
