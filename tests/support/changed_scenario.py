"""A built-in scenario with parts of its text replaced, so that an episode takes a moment."""

from collections.abc import Mapping
from pathlib import Path

import serd_sim

_BUILT_IN = Path(serd_sim.__file__).parent / "scenario" / "scenarios"


def changed_scenario(folder: Path, name: str, changes: Mapping[str, str]) -> Path:
    """The file near.yaml in the folder; changes: from a part of the text to another."""
    text = (_BUILT_IN / f"{name}.yaml").read_text()
    for usual, changed in changes.items():
        assert usual in text
        text = text.replace(usual, changed)
    file = folder / "near.yaml"
    file.write_text(text)
    return file
