#!/usr/bin/env bash
# Tests of mathematics and strategy with the NumPy and SciPy of Ubuntu 24.04, in a virtual environment
# of their own (.venv-ubuntu), which is kept. Arguments: other tests.
set -euo pipefail
cd "$(dirname "$0")/.."
export VENV=.venv-ubuntu
[ -e "$VENV/.all" ] || bash tools/setup_venv.sh all
"$VENV/bin/pip" install --quiet numpy==1.26.4 scipy==1.11.4 "pandas>=2.2,<3"
[ $# -gt 0 ] || set -- tests/serd_core tests/serd_app/navigation
"$VENV/bin/python" -m pytest -q -n 2 "$@"
