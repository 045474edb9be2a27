"""`make bench`: every benchmark, or those named.

Linear algebra gets one thread, so that processor times of ways with and without it compare.
"""

import argparse
import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

# The libraries read the variable when they load.
from benchmarks import speed_figure, start_up
from benchmarks.driving import (
    arrival_bands,
    closed_loop,
    crowd_peers,
    drives,
    latency,
    lockstep,
    planners,
    tracker,
)
from benchmarks.faults import kill_matrix
from benchmarks.learning import (
    belief_bound,
    belief_choice,
    belief_recorded,
    calibration,
    gradient,
    growth,
    peers,
    route_peers,
    scarce_data,
    solvers,
)
from benchmarks.recordings import bag_faults, bags_throughput, compliance, receipt_times, sources

BENCHMARKS = {
    "arrival_bands": arrival_bands.run,
    "bag_faults": bag_faults.run,
    "bags_throughput": bags_throughput.run,
    "belief_bound": belief_bound.run,
    "belief_choice": belief_choice.run,
    "belief_recorded": belief_recorded.run,
    "calibration": calibration.run,
    "closed_loop": closed_loop.run,
    "compliance": compliance.run,
    "crowd_peers": crowd_peers.run,
    "drives": drives.run,
    "gradient": gradient.run,
    "growth": growth.run,
    "kill_matrix": kill_matrix.run,
    "latency": latency.run,
    "learning_peers": peers.run,
    "lockstep": lockstep.run,
    "planners": planners.run,
    "receipt_times": receipt_times.run,
    "route_peers": route_peers.run,
    "sources": sources.run,
    "scarce_data": scarce_data.run,
    "solvers": solvers.run,
    "speed_figure": speed_figure.run,
    "start_up": start_up.run,
    "tracker": tracker.run,
}


def main() -> None:
    """Run them one after the other; each writes results/<name>.json."""
    parser = argparse.ArgumentParser(prog="make bench ARGS=...", description=__doc__)
    parser.add_argument(
        "names", nargs="*", choices=[[], *BENCHMARKS], help="all when none is named"
    )
    for name in parser.parse_args().names or BENCHMARKS:
        BENCHMARKS[name]()


if __name__ == "__main__":
    main()
