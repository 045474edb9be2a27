"""What `serd` costs before it does anything: each help and a misspelt option, beside a Python that
does nothing.

Processor time, the least of several runs.
"""

import resource
import subprocess
import sys

from lab.benchmarks.report import Row, save
from serd_cli.signatures import known_signatures

_N_RUNS = 5
_SERD = "from serd_cli.main import main; main()"


def run() -> None:
    """Measure each command."""
    helps = [f"{words} --help" for words in known_signatures()]
    rows: list[Row] = []
    for words in ("--version", "--help", *helps, "learn --misspelt", "bag play --misspelt"):
        # In turns, because the speed of a machine that does other work changes.
        spent = [
            (_processor_s("pass"), _processor_s(_SERD, *words.split())) for _ in range(_N_RUNS)
        ]
        nothing_s, command_s = map(min, zip(*spent, strict=True))
        times = round(command_s / nothing_s, 1)
        rows.append(
            {"command": f"serd {words}", "s": round(command_s, 3), "times python -c pass": times}
        )
    save("start_up", "Processor time of a command that does nothing", rows)


def _processor_s(program: str, *words: str) -> float:
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([sys.executable, "-c", program, *words], check=False, capture_output=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
