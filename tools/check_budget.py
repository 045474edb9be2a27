"""Lines of Python per folder against budget.toml, which only a decision record may raise.

    .venv/bin/python tools/check_budget.py

Counted are the lines of tracked Python files, as the formatter sets them, and what all tracked
files take on disk.
"""

import subprocess
import sys
from pathlib import Path

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ROOT = Path(__file__).resolve().parents[1]
BUDGET = Path(__file__).with_name("budget.toml")


def tracked(*patterns: str) -> list[Path]:
    """Tracked files that exist, of these patterns or all."""
    words = ["git", "ls-files", "-z", "--", *patterns]
    names = subprocess.run(words, cwd=ROOT, check=True, capture_output=True, text=True).stdout
    return [path for name in filter(None, names.split("\0")) if (path := ROOT / name).is_file()]


def n_lines(paths: list[Path]) -> int:
    """Lines of the files together."""
    return sum(len(path.read_text(encoding="utf-8").splitlines()) for path in paths)


def main() -> int:
    """Print what there is and what may be; 1 where there is more."""
    budget = tomllib.loads(BUDGET.read_text(encoding="utf-8"))
    files = {name: tracked(f"{name}/*.py", f"{name}/*.pyi") for name in budget["lines"]}
    product = [path for name in budget["product"]["folders"] for path in files[name]]
    rows = [(name, n_lines(paths), budget["lines"][name]) for name, paths in files.items()]
    rows += [
        ("lines of the product", n_lines(product), budget["product"]["lines"]),
        ("modules of the product", len(product), budget["product"]["modules"]),
        ("kB tracked", sum(path.stat().st_size for path in tracked()) // 1000, budget["kB"]),
    ]
    for name, found, most in rows:
        print(f"{name:24}{found:8,}{most:8,}{'' if found <= most else '   too many'}")
    over = [name for name, found, most in rows if found > most]
    counted = {path for paths in files.values() for path in paths}
    uncounted = sorted(set(tracked("*.py", "*.pyi")) - counted)
    over += [f"{path.relative_to(ROOT)} (in no folder of the budget)" for path in uncounted]
    if over:
        print(
            f"budget: {', '.join(over)} must not grow; take something out, or raise the number in"
            " tools/budget.toml with a decision record (docs/decisions) of what left for it",
            file=sys.stderr,
        )
    return 1 if over else 0


if __name__ == "__main__":
    sys.exit(main())
