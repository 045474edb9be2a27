#!/usr/bin/env bash
# Build the interfaces that have no wheel, by the generators of the ROS wheels, and install them into
# the environment whose folder bin is the argument: serd_msgs of ros_ws, and the two navigation
# actions of nav2_msgs. Needs gcc, g++ and Python's headers, and takes 20 s each. A package that is
# installed stays; a full ROS installation has nav2_msgs, and colcon builds serd_msgs there.
set -euo pipefail
bin=$(cd "$1" && pwd)
workspace=$(cd "$(dirname "$0")/../ros_ws/src" && pwd)
read -r prefix site headers suffix numpy < <("$bin/python" -c 'import numpy, sys, sysconfig
paths = sysconfig.get_paths()
print(sys.prefix, paths["purelib"], paths["include"], sysconfig.get_config_var("EXT_SUFFIX"), numpy.get_include())')
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"

# Each generator is found twice in an environment of wheels, which rosidl only warns of.
export AMENT_PREFIX_PATH=$prefix
known="action_msgs service_msgs builtin_interfaces geometry_msgs std_msgs unique_identifier_msgs"

# The package in $folder/NAME, of the interface files that are named after it.
build() {
  local package=$1 made=made_$1 kind package_of part; shift
  local sources interfaces described includes rosidl flags libraries support introspection library
  includes=$(printf -- " -I $prefix/share/%s" $known)
  sources=$(printf " $folder/$package:%s" "$@")
  interfaces=$(sed -E 's/\.(action|msg|srv)/.idl/g' <<<"$sources")
  described=$(printf -- " -td $folder/$package/%s.json" "${@%.*}")
  rosidl=("$bin/python" -W ignore "$bin/rosidl")
  {
    "${rosidl[@]}" translate --to idl -o "$package" "$package" $sources
    "${rosidl[@]}" hash -o "$package" $includes "$package" $interfaces
    "${rosidl[@]}" generate -o "$made" $includes $described "$package" $interfaces
  } >rosidl.log 2>&1 || { cat rosidl.log >&2; exit 1; }

  # One library is all type supports, since rosidl_typesupport_c loads each by its name.
  flags="-O1 -fPIC -w -I$numpy -I$headers -I$prefix/include"
  for part in "$prefix"/include/*/; do flags+=" -I$part"; done
  for kind in c fastrtps_c introspection_c; do
    mkdir -p "include_$kind"
    ln -s "$folder/$made/$kind" "include_$kind/$package"
    flags+=" -Iinclude_$kind"
  done
  rm "$made"/py/*.ep.rosidl_typesupport_{fastrtps,introspection}_c.c
  find "$made"/{c,fastrtps_c,introspection_c,py} -name '*.c' -print0 | xargs -0 -P 2 -I{} gcc -std=gnu11 $flags -c {} -o {}.o
  find "$made"/{c,fastrtps_c,introspection_c} -name '*.cpp' -print0 | xargs -0 -P 2 -I{} g++ -std=c++17 $flags -c {} -o {}.o
  support=rosidl_typesupport_fastrtps_c
  introspection=rosidl_typesupport_introspection_c
  libraries="-L$prefix/lib -lrosidl_runtime_c -lrosidl_typesupport_c -l$support -l${support}pp -l$introspection -lrmw -lfastcdr -lrcutils"
  for package_of in $known; do
    for part in rosidl_generator_c rosidl_generator_py rosidl_typesupport_c $support $introspection; do
      libraries+=" -l${package_of}__$part"
    done
  done
  library=${package}__$support
  g++ -shared -o "$prefix/lib/lib$library.so" $(find "$made"/{c,fastrtps_c,introspection_c} -name '*.o') $libraries
  ln -sf "lib$library.so" "$prefix/lib/lib${package}__$introspection.so"
  g++ -shared -o "$made/py/${package}_s__rosidl_typesupport_c$suffix" $(find "$made/py" -name '*.o') $libraries -l$library

  for kind in action msg srv; do
    [ ! -d "$package/$kind" ] || { mkdir -p "$prefix/share/$package" && cp -r "$package/$kind" "$prefix/share/$package"; }
  done
  touch "$made/py/__init__.py"
  find "$made/py" -name '*.[co]' -delete
  # Renamed when it is complete: what was interrupted is not taken for installed.
  rm -rf "$site/$package.partial"
  cp -r "$made/py" "$site/$package.partial"
  rm -rf "${site:?}/$package"
  mv "$site/$package.partial" "$site/$package"
  echo "$package: built and installed"
}

# Whether a package is installed, with the definitions that the workspace has of it; says so.
is_installed() {
  local each
  for each in "$workspace/$1"/{msg,srv}/*; do
    [ ! -e "$each" ] || cmp -s "$each" "$prefix/share/${each#"$workspace/"}" || return 1
  done
  "$bin/python" -c "import $1" 2>/dev/null && echo "$1: installed already"
}

if is_installed nav2_msgs && is_installed serd_msgs; then exit 0; fi
if ! command -v gcc >/dev/null || ! command -v g++ >/dev/null || [ ! -e "$headers/Python.h" ]; then
  echo "the interfaces are compiled, which needs gcc, g++ and $headers/Python.h; run: apt-get install g++ python3-dev" >&2
  exit 2
fi

if ! is_installed nav2_msgs >/dev/null; then
  mkdir -p nav2_msgs/action
  outcome="---
uint16 NONE=0
uint16 error_code
---
geometry_msgs/PoseStamped current_pose
builtin_interfaces/Duration navigation_time
builtin_interfaces/Duration estimated_time_remaining
int16 number_of_recoveries
float32 distance_remaining"
  printf '%s\n' "geometry_msgs/PoseStamped pose" "string behavior_tree" "$outcome" \
    >nav2_msgs/action/NavigateToPose.action
  printf '%s\n' "geometry_msgs/PoseStamped[] poses" "string behavior_tree" "$outcome" \
    "int16 number_of_poses_remaining" >nav2_msgs/action/NavigateThroughPoses.action
  build nav2_msgs action/NavigateToPose.action action/NavigateThroughPoses.action
fi
if ! is_installed serd_msgs >/dev/null; then
  mkdir serd_msgs
  cp -r "$workspace"/serd_msgs/{msg,srv} serd_msgs
  build serd_msgs $(cd serd_msgs && ls msg/*.msg srv/*.srv)
fi
