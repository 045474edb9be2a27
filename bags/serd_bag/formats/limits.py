"""What reading one file may cost, whatever it holds: no size that a file declares is trusted.

Memory: chunks larger than LARGEST_CONTENT are read in parts, larger rows of SQLite whole; at most
three contents of that size are in memory at once. Time: what a file unpacks to, and its number of
records, are bounded by its size, with ample room for real recordings. YAML of a bag may hold no
references, which can repeat without end.
"""

import json
import re
from typing import Any

import yaml

from serd_bag.errors import BagError

LARGEST_CONTENT = 64 << 20
#: A message that stands in a file as it is; one of a compressed chunk may be 64 MiB, and more where
#: it is not this much larger than the packed chunk.
LARGEST_MESSAGE, MOST_PACKED = 256 << 20, 30
#: Of one schema, channel or statistics record, and of all definitions of a file.
LARGEST_DEFINITION = 4 << 20
MOST_DEFINITIONS = 32 << 20
#: Lines in which the faults of a bag are reported.
MOST_FAULTS = 20
MOST_FAULTS_OF_A_FILE = 12
#: Of JSON, what YAML takes for a line break or does not allow.
_ESCAPED = re.compile("[\x7f-\x9f\u2028\u2029\ufeff\ufffe\uffff\ud800-\udfff]")
_LONGEST_YAML, _DEEPEST = 4 << 20, 20
_Loader = yaml.CSafeLoader if yaml.__with_libyaml__ else yaml.SafeLoader


class _Dumper(yaml.CSafeDumper if yaml.__with_libyaml__ else yaml.SafeDumper):  # type: ignore[misc]
    def ignore_aliases(self, data: object) -> bool:  # noqa: ARG002 (whatever it is)
        return True


def yaml_text(values: Any) -> str:
    """YAML without references, keys in their order."""
    text: str = yaml.dump(values, Dumper=_Dumper, sort_keys=False, default_flow_style=False)
    return text


def flow_yaml_text(values: Any) -> str:
    """YAML on one line, as JSON: a tenth of the time, while messages of a recorder wait."""
    text = json.dumps(values, ensure_ascii=False, default=str)
    return _ESCAPED.sub(lambda found: f"\\u{ord(found[0]):04x}", text)


def most_unpacked(file_size: int) -> int:
    """Bytes to which a file may unpack."""
    return (512 << 20) + 25 * file_size


def most_records(file_size: int) -> int:
    """Records that are read of a file."""
    return 1_000_000 + file_size // 8


def yaml_values(text: str) -> Any:
    """Values of the text; BagError where it is no YAML, too long or refers to its own parts."""
    if len(text) > _LONGEST_YAML:
        raise BagError(
            f"YAML of a bag must have {_LONGEST_YAML} characters at most, got {len(text)}"
        )
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
