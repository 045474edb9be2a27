"""Execute the notebooks of docs, and fail where one prints other than it shows.

`--write` keeps the new outputs. Pictures are drawn anew but not compared. nbclient is in the extra
`docs`.
"""

import difflib
import json
import os
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
NOTEBOOKS = sorted((ROOT / "docs").rglob("*.ipynb"))
#: Of a cell.
_LONGEST_S = 1800


def executed(path: Path) -> Any:
    """The notebook with the outputs of a new kernel, in the folder of the notebook."""
    import nbformat
    from nbclient import NotebookClient

    notebook = nbformat.read(path, as_version=4)
    os.environ["PATH"] = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    os.environ["COLUMNS"] = "100"
    where = {"metadata": {"path": str(path.parent)}}
    NotebookClient(
        notebook, timeout=_LONGEST_S, kernel_name="python3", resources=where, record_timing=False
    ).execute()
    return notebook


def printed_lines(notebook: Any) -> list[str]:
    """What each cell prints, line by line; for a picture its description."""
    lines = []
    for number, cell in enumerate(notebook["cells"], 1):
        # A kernel divides a stream at any byte.
        printed = ""
        for output in cell.get("outputs", ()):
            text = output.get("text") or [*output.get("data", {}).get("text/plain", ""), "\n"]
            printed += "".join(text)
        lines += [f"cell {number}: {line}" for line in printed.splitlines()]
    return lines


def differences(shown: Any, found: Any) -> list[str]:
    """A unified diff of what two notebooks print."""
    lines = printed_lines(shown), printed_lines(found)
    return list(difflib.unified_diff(*lines, "shown", "printed", lineterm="", n=1))


def main() -> int:
    """Entry point."""
    import nbformat

    is_stale = False
    for path in NOTEBOOKS:
        found = executed(path)
        if "--write" in sys.argv:
            nbformat.write(found, path)
            continue
        different = differences(json.loads(path.read_text(encoding="utf-8")), found)
        if different:
            is_stale = True
            print(f"{path.relative_to(ROOT)} prints other than it shows;", file=sys.stderr)
            print("run tools/run_notebooks.py --write", *different, sep="\n", file=sys.stderr)
    return int(is_stale)


if __name__ == "__main__":
    sys.exit(main())
