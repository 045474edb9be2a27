#!/usr/bin/env bash
# Build the two navigation actions of nav2_msgs, which has no wheel, by the generators of the ROS
# wheels, and install them into the environment whose folder bin is the argument. Needs gcc, g++ and
# Python's headers, and takes 20 s. A package that is installed stays; a full ROS installation has it.
set -euo pipefail
bin=$(cd "$1" && pwd)
if "$bin/python" -c 'import nav2_msgs' 2>/dev/null; then
  echo "nav2_msgs: installed already"
  exit 0
fi
read -r prefix site headers suffix numpy < <("$bin/python" -c 'import numpy, sys, sysconfig
paths = sysconfig.get_paths()
print(sys.prefix, paths["purelib"], paths["include"], sysconfig.get_config_var("EXT_SUFFIX"), numpy.get_include())')
if ! command -v gcc >/dev/null || ! command -v g++ >/dev/null || [ ! -e "$headers/Python.h" ]; then
  echo "the interfaces are compiled, which needs gcc, g++ and $headers/Python.h; run: apt-get install g++ python3-dev" >&2
  exit 2
fi

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
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

# Each generator is found twice in an environment of wheels, which rosidl only warns of.
export AMENT_PREFIX_PATH=$prefix
known="action_msgs service_msgs builtin_interfaces geometry_msgs std_msgs unique_identifier_msgs"
includes=$(printf -- " -I $prefix/share/%s" $known)
names="NavigateToPose NavigateThroughPoses"
actions=$(printf " $folder/nav2_msgs:action/%s.action" $names)
interfaces=${actions//.action/.idl}
described=$(printf -- " -td $folder/nav2_msgs/action/%s.json" $names)
rosidl=("$bin/python" -W ignore "$bin/rosidl")
{
  "${rosidl[@]}" translate --to idl -o nav2_msgs nav2_msgs $actions
  "${rosidl[@]}" hash -o nav2_msgs $includes nav2_msgs $interfaces
  "${rosidl[@]}" generate -o made $includes $described nav2_msgs $interfaces
} >rosidl.log 2>&1 || { cat rosidl.log >&2; exit 1; }

# One library is all type supports, since rosidl_typesupport_c loads each by its name.
flags="-O1 -fPIC -w -I$numpy -I$headers -I$prefix/include"
for include in "$prefix"/include/*/; do flags+=" -I$include"; done
for kind in c fastrtps_c introspection_c; do
  mkdir "include_$kind"
  ln -s "$folder/made/$kind" "include_$kind/nav2_msgs"
  flags+=" -Iinclude_$kind"
done
rm made/py/*.ep.rosidl_typesupport_{fastrtps,introspection}_c.c
find made/{c,fastrtps_c,introspection_c,py} -name '*.c' -print0 | xargs -0 -P 2 -I{} gcc -std=gnu11 $flags -c {} -o {}.o
find made/{c,fastrtps_c,introspection_c} -name '*.cpp' -print0 | xargs -0 -P 2 -I{} g++ -std=c++17 $flags -c {} -o {}.o
support=rosidl_typesupport_fastrtps_c
introspection=rosidl_typesupport_introspection_c
libraries="-L$prefix/lib -lrosidl_runtime_c -lrosidl_typesupport_c -l$support -l${support}pp -l$introspection -lrmw -lfastcdr -lrcutils"
for package in $known; do
  for part in rosidl_generator_c rosidl_generator_py rosidl_typesupport_c $support $introspection; do
    libraries+=" -l${package}__$part"
  done
done
library=nav2_msgs__$support
g++ -shared -o "$prefix/lib/lib$library.so" $(find made/{c,fastrtps_c,introspection_c} -name '*.o') $libraries
ln -sf "lib$library.so" "$prefix/lib/libnav2_msgs__$introspection.so"
g++ -shared -o "made/py/nav2_msgs_s__rosidl_typesupport_c$suffix" $(find made/py -name '*.o') $libraries -l$library

mkdir -p "$prefix/share/nav2_msgs"
cp -r nav2_msgs/action "$prefix/share/nav2_msgs"
touch made/py/__init__.py
find made/py -name '*.[co]' -delete
# Renamed when it is complete: what was interrupted is not taken for installed.
rm -rf "$site/nav2_msgs.partial"
cp -r made/py "$site/nav2_msgs.partial"
mv "$site/nav2_msgs.partial" "$site/nav2_msgs"
echo "nav2_msgs: built and installed"
