#!/bin/sh
# Record the three bags again through ROS topics, in lock-step, from the root of a checkout:
#     sh bags/data/record.sh FOLDER    (a new one)
set -eu
mkdir "$1"
python -c 'from pathlib import Path
from lab.experiments.study.settings import study_settings
from lab.experiments.study.study import Study
from serd_files.yaml_config import model_yaml
print(model_yaml(Study(study_settings(), Path()).scenario))' > "$1/hallway.yaml"
record() {
  serd launch demonstrate scenario:="$1/hallway.yaml" seed:="$4" start_area:="$5" \
    scripted_expert.driver:=varied_expert scripted_expert.episodes:="$3" \
    'demo_recorder.topics:=[robot_pose, intent, episode, map]' demo_recorder.output:="$1/plain-$2"
  serd bag convert "$1/plain-$2" --output "$1/$2" --compression zstd
}
record "$1" training 20 5000 train
record "$1" test 10 5001 train
record "$1" transfer 10 5002 transfer
