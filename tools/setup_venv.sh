#!/usr/bin/env bash
# Create the virtual environment and install the project with everything it needs.
set -euo pipefail
: "${PYTHON:?}" "${VENV:?}"

version=$("$PYTHON" -c 'import sys; print("%d.%d" % sys.version_info[:2])')
case "$version" in
  3.10|3.11) ;;
  3.12)
    echo "setup: Python 3.12 has no PyBullet wheel; it is compiled now (about 7 minutes)."
    command -v g++ >/dev/null || {
      echo "setup: PyBullet needs a C++ compiler: sudo apt-get install g++ python3-dev" >&2
      exit 2
    }
    export PIP_PROGRESS_BAR=on
    verbose="-v"
    ;;
  *)
    echo "setup: found Python $version; the ROS 2 Jazzy and PyBullet wheels need 3.10, 3.11 or 3.12." >&2
    echo "setup: install one (sudo apt-get install python3.11 python3.11-venv) or name it: make PYTHON=/path/to/python3.11 setup" >&2
    exit 2
    ;;
esac

if [ "$(uname -s)-$(uname -m)" != "Linux-x86_64" ]; then
  echo "setup: the ROS 2 wheels exist for x86-64 Linux only, this is $(uname -s) $(uname -m)." >&2
  echo "setup: use ros_ws in a full Jazzy installation instead (see README)." >&2
  exit 2
fi

if ! "$PYTHON" -c 'import ensurepip, venv' 2>/dev/null; then
  echo "setup: this Python has no venv module: sudo apt-get install python$version-venv" >&2
  exit 2
fi

echo "setup: creating $VENV with Python $version and installing (one to two minutes) ..."
[ -x "$VENV/bin/python" ] || "$PYTHON" -m venv "$VENV"
"$VENV/bin/python" -m pip install ${verbose:--q} --disable-pip-version-check \
  -c constraints.txt -e ./serd_core -e ./bags -e '.[workspace,dev]' -e ./lab 2> >(grep -v '^WARNING: Location' >&2)
touch "$VENV/.ready"
echo "setup: done."
