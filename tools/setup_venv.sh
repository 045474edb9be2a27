#!/usr/bin/env bash
# Create the virtual environment and install the project: with `run` what it needs to run, with `all`
# what developers need too, with `docs` what makes the site besides.
set -euo pipefail
: "${PYTHON:?}" "${VENV:?}"
case "${1:-run}" in
  run) what="what it needs to run"; extras="sim"; lab=() ;;
  all) what="what developers need"; extras="sim,workspace,dev"; lab=(-e ./lab) ;;
  docs) what="what the site needs"; extras="sim,workspace,dev,docs"; lab=(-e ./lab) ;;
  *) echo "setup: name run, all or docs, got $1" >&2; exit 2 ;;
esac
projects=(-e ./serd_core -e ./bags -e ".[$extras]" "${lab[@]}")

version=$("$PYTHON" -c 'import sys; print("%d.%d" % sys.version_info[:2])')
verbose=-q
case "$version" in
  3.10|3.11) ;;
  3.12)
    echo "setup: Python 3.12 has no PyBullet wheel; it is compiled now (about 7 minutes)."
    command -v g++ >/dev/null || {
      echo "setup: PyBullet needs a C++ compiler: sudo apt-get install g++ python3-dev" >&2
      exit 2
    }
    verbose=-v
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

echo "setup: installing $what into $VENV with Python $version ..."
[ -x "$VENV/bin/python" ] || "$PYTHON" -m venv "$VENV"
pip=("$VENV/bin/python" -m pip)
uv=$(command -v "$VENV/bin/uv" || command -v uv || true)
if [ -z "$uv" ]; then
  "${pip[@]}" install -q --disable-pip-version-check -c constraints.txt uv >/dev/null 2>&1 || true
  uv=$(command -v "$VENV/bin/uv" || true)
fi
if [ -z "$uv" ] || ! "$uv" pip install --python "$VENV/bin/python" $verbose -c constraints.txt "${projects[@]}"; then
  echo "setup: uv, which takes ten seconds, could not install; pip takes two to three minutes ..."
  [ "$verbose" = -q ] || export PIP_PROGRESS_BAR=on
  "${pip[@]}" install $verbose --disable-pip-version-check -c constraints.txt "${projects[@]}" \
    2> >(grep -v '^WARNING: Location' >&2)
fi
if [ "${1:-run}" != run ]; then
  # Only its file axe.min.js is used, not the driver of browsers that the package requires.
  "${pip[@]}" install -q --disable-pip-version-check --no-deps -c constraints.txt \
    axe-playwright-python 2> >(grep -v '^WARNING: Location' >&2)
fi
# What was installed for more is there for less.
case "${1:-run}" in docs) stamps="docs all run" ;; all) stamps="all run" ;; *) stamps=run ;; esac
for stamp in $stamps; do touch "$VENV/.$stamp"; done
echo "setup: done."
