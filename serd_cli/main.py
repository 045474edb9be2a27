"""The `serd` command; exit codes: 0 done, 1 a run failed, 2 bad usage or input, 130 interrupted."""

import sys

from serd_ros.process.executable import starting


def main() -> int:
    """Entry point; Ctrl-C while modules are still being imported ends it quietly."""
    with starting():
        from serd_cli.app import make_app, run

        app = make_app()
    return run(app)


if __name__ == "__main__":
    sys.exit(main())
