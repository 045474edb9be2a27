"""`make bench`: every benchmark, or those named."""

import argparse

from benchmarks import (
    bags_throughput,
    closed_loop,
    crowd_peers,
    gradient,
    growth,
    learning_peers,
    lockstep,
)

BENCHMARKS = {
    "bags_throughput": bags_throughput.run,
    "closed_loop": closed_loop.run,
    "crowd_peers": crowd_peers.run,
    "gradient": gradient.run,
    "growth": growth.run,
    "learning_peers": learning_peers.run,
    "lockstep": lockstep.run,
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
