"""YAML of a bag, which may come from anywhere: no references, which can repeat without end."""

from typing import Any

import yaml

from bags.errors import BagError

_LONGEST = 4 << 20
_DEEPEST = 20
_Loader = yaml.CSafeLoader if yaml.__with_libyaml__ else yaml.SafeLoader


def yaml_values(text: str) -> Any:
    """Values of the text; BagError where it is no YAML, too long or refers to its own parts."""
    if len(text) > _LONGEST:
        raise BagError(f"YAML of a bag must have {_LONGEST} characters at most, got {len(text)}")
    try:
        depth = 0
        for event in yaml.parse(text, _Loader):
            depth += isinstance(event, yaml.CollectionStartEvent)
            depth -= isinstance(event, yaml.CollectionEndEvent)
            if isinstance(event, yaml.AliasEvent) or depth > _DEEPEST:
                raise BagError("YAML of a bag must not refer to its own parts or be nested deeply")
        return yaml.load(text, _Loader)  # noqa: S506 (one of two safe loaders)
    except (yaml.YAMLError, ValueError, TypeError, RecursionError) as error:
        raise BagError(str(error).splitlines()[0]) from None
