"""Lines of tracked Python files per folder against budget.toml; `make budget` runs it."""

import subprocess
import sys
from pathlib import Path

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ROOT = Path(__file__).resolve().parents[1]


def main() -> int:
    names = subprocess.check_output(["git", "ls-files", "-z"], cwd=ROOT, text=True).split("\0")
    tracked = [Path(name) for name in names if (ROOT / name).is_file()]
    n_lines = {
        path: len((ROOT / path).read_text(encoding="utf-8").splitlines())
        for path in tracked
        if path.suffix in (".py", ".pyi")
    }
    budget = tomllib.loads((ROOT / "tools" / "budget.toml").read_text(encoding="utf-8"))
    product = [n for path, n in n_lines.items() if path.parts[0] in budget["product"]["folders"]]
    rows = [
        (name, sum(n for path, n in n_lines.items() if path.parts[0] == name), most)
        for name, most in budget["lines"].items()
    ]
    rows += [
        ("lines of the product", sum(product), budget["product"]["lines"]),
        ("modules of the product", len(product), budget["product"]["modules"]),
        ("kB tracked", sum((ROOT / path).stat().st_size for path in tracked) // 1000, budget["kB"]),
    ]
    for name, found, most in rows:
        print(f"{name:24}{found:8,}{most:8,}{'' if found <= most else '   too many'}")
    over = [name for name, found, most in rows if found > most]
    uncounted = sorted(path for path in n_lines if path.parts[0] not in budget["lines"])
    over += [f"{path} (in no folder of the budget)" for path in uncounted]
    if over:
        print(
            f"budget: {', '.join(over)} must not grow; take something out, or raise the number in"
            " tools/budget.toml with a decision record (docs/decisions) of what left for it",
            file=sys.stderr,
        )
    return int(bool(over))


if __name__ == "__main__":
    sys.exit(main())
