"""Settings declared once: default, range, unit and description stand on the field of a model.

Command options, node parameters and reference pages are generated from these fields.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Literal

from pydantic import BaseModel, Field
from pydantic.fields import FieldInfo

_LIMITS = {"minimum": ">= ", "exclusiveMinimum": "> ", "maximum": "<= ", "exclusiveMaximum": "< "}


#: How a node's parameter may change while the node runs: not at all, to any value, or with lower or
#: higher values as the stricter ones.
Live = Literal["", "any", "lower", "higher"]


def setting(
    default: Any, description: str, *, unit: str = "", live: Live = "", **rules: Any
) -> Any:
    """A pydantic field. description: a phrase without a full stop; rules: as `Field` has them."""
    extra: dict[str, Any] = {"unit": unit, "live": live}
    return Field(default, description=description, json_schema_extra=extra, **rules)


def setting_of(model: type[BaseModel], name: str, **changes: Any) -> Any:
    """A setting of another model, with a default or a description of its own where given."""
    return FieldInfo.merge_field_infos(model.model_fields[name], **changes)


@dataclass(frozen=True)
class Setting:
    """A setting as it is documented; schema: its JSON schema, which holds the range."""

    name: str
    default: Any
    schema: dict[str, Any]

    @property
    def description(self) -> str:
        """What it sets, with the unit in parentheses."""
        text, unit = str(self.schema["description"]), self.schema.get("unit")
        return f"{text} ({unit})" if unit else text

    @property
    def live(self) -> Live:
        """How it may change while a node runs."""
        found: Live = self.schema.get("live", "")
        return found

    @property
    def limits(self) -> dict[str, float]:
        """Those of minimum, exclusiveMinimum, maximum and exclusiveMaximum that it has."""
        return {name: self.schema[name] for name in _LIMITS if name in self.schema}

    @property
    def range(self) -> str:
        """The allowed values: `> 0, <= 0.5` or `optimal, soft`; empty when any are."""
        limits = [f"{_LIMITS[name]}{limit:g}" for name, limit in self.limits.items()]
        return ", ".join(limits or self.schema.get("enum", ()))


def settings_of(model: type[BaseModel]) -> Iterator[Setting]:
    """The settings of a model in their order."""
    for name, schema in model.model_json_schema()["properties"].items():
        variants = [each for each in schema.get("anyOf", ()) if each["type"] != "null"]
        merged = {**schema, **(variants[0] if variants else {})}
        yield Setting(name, model.model_fields[name].default, merged)
