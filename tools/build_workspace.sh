#!/usr/bin/env bash
# Build the package serd_ros of ros_ws with plain colcon; quiet unless it fails. serd_msgs needs the
# CMake files of a full ROS installation, so it is left out; tools/build_interfaces.sh builds it.
set -euo pipefail
bin=$(cd "$1" && pwd)
cd "$(dirname "$0")/../ros_ws"
# Modules that were moved or deleted would stay importable in the installed copy.
rm -rf build/serd_ros/build install/serd_ros
log=$(mktemp)
trap 'rm -f "$log"' EXIT
if ! PATH="$bin:$PATH" "$bin/colcon" build --base-paths src/serd_ros >"$log" 2>&1; then
  cat "$log" >&2
  echo "build: colcon could not build ros_ws (see above)." >&2
  exit 1
fi
