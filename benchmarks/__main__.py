"""`make bench`: every benchmark, or those named.

Linear algebra gets one thread, so that processor times of ways with and without it compare.
"""

import argparse
import os
from importlib import import_module

# The libraries read the variable when they load.
os.environ.setdefault("OMP_NUM_THREADS", "1")

#: Modules by folder; the speed figure is drawn of the results of others.
FOLDERS = {
    "driving": "arrival_bands closed_loop crowd_peers drives latency lockstep planners tracker",
    "faults": "kill_matrix",
    "learning": (
        "belief_bound belief_choice belief_recorded calibration gradient growth learning_peers"
        " route_peers scarce_data solvers"
    ),
    "recordings": "bag_faults bags_throughput compliance receipt_times sources",
    "": "speed_figure start_up",
}
MODULES = {name: folder for folder, names in FOLDERS.items() for name in names.split()}


def main() -> None:
    """Run them one after the other; each writes results/<name>.json."""
    parser = argparse.ArgumentParser(prog="make bench ARGS=...", description=__doc__)
    parser.add_argument("names", nargs="*", choices=[[], *MODULES], help="all when none is named")
    for name in parser.parse_args().names or MODULES:
        import_module(".".join(filter(None, ("benchmarks", MODULES[name], name)))).run()


if __name__ == "__main__":
    main()
