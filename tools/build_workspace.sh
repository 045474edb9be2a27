#!/usr/bin/env bash
# Build serd_ros and serd_bringup with plain colcon; quiet unless it fails. serd_msgs needs the CMake
# files of a full ROS installation, so it is left out; tools/build_interfaces.sh builds it.
set -euo pipefail
bin=$(cd "$1" && pwd)
cd "$(dirname "$0")/../ros_ws"
# Modules that were moved or deleted would stay importable in the installed copy.
rm -rf build/serd_{ros,bringup}/build install/serd_{ros,bringup}
log=$(mktemp)
trap 'rm -f "$log"' EXIT
if ! PATH="$bin:$PATH" "$bin/colcon" build --base-paths src/serd_ros src/serd_bringup >"$log" 2>&1; then
  cat "$log" >&2
  echo "build: colcon could not build ros_ws (see above)." >&2
  exit 1
fi
