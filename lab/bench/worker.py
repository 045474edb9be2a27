"""Runs one method on the cases of a folder, in the environment of the method.

    python worker.py METHOD.py FOLDER

Reads `case_N.npz` in turn, writes `result_N.npz`, and prints a line of JSON after each: the number,
processor seconds (of the first case also cold: from the start of the process, and warm: of a second
call), or why there is no result.
"""

import json
import runpy
import sys
import time
from pathlib import Path

import numpy as np


def main(method: str, folder: Path) -> None:
    """Learn from every case."""
    learn = None
    for file in sorted(folder.glob("case_*.npz"), key=lambda path: int(path.stem[5:])):
        with np.load(file) as content:
            given = dict(content)
        line: dict[str, float | str] = {"case": int(file.stem[5:])}
        try:
            if learn is None:
                learn = runpy.run_path(method)["learn"]
                learn(given)
                line["cold_s"] = time.process_time()
            begun_s = time.process_time()
            result = learn(given)
            line["warm_s"] = time.process_time() - begun_s
            result = {name: value for name, value in result.items() if value is not None}
            np.savez(folder / f"result_{line['case']}.npz", **result)
        except NotImplementedError as refused:
            line["refused"] = str(refused)
        except Exception as error:  # of any library
            line["failed"] = f"{type(error).__name__}: {error}"[:200]
        print("BENCH " + json.dumps(line), flush=True)


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]))
