"""The study's tables as Markdown, and a page whose tables are filled from a finished study.

A page has blocks `<!-- table NAME -->` ... `<!-- end -->`; what stands between is written anew:

    python -m experiments.study.page.markdown docs/hallway_study.md
"""

import re
import sys
from pathlib import Path

from experiments.study.page.arrival_tables import ARRIVAL_TABLES
from experiments.study.page.learning_tables import LEARNING_TABLES
from experiments.study.run import KEPT
from serd_core.errors import SerdError
from storage.files import atomic_write_text, read_text

_BLOCK = re.compile(r"(<!-- table (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)
TABLES = LEARNING_TABLES | ARRIVAL_TABLES


def filled(page: str, folder: Path) -> str:
    """The page with every table made from the tables of a finished study."""

    def block(match: re.Match[str]) -> str:
        name = match[2]
        if name not in TABLES:
            raise SerdError(f"table must be one of {', '.join(TABLES)}, got {name!r}")
        return f"{match[1]}\n{TABLES[name](folder)}\n{match[3]}"

    return _BLOCK.sub(block, page)


if __name__ == "__main__":
    for name in sys.argv[1:]:
        atomic_write_text(name, filled(read_text(name), KEPT))
