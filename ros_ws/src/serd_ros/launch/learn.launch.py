"""ros2 launch serd_ros learn.launch.py bag:=recording output:=model.yaml

Rewards and dynamics are learned from a bag.
"""

from pathlib import Path
from runpy import run_path


def generate_launch_description():
    shared = run_path(str(Path(__file__).with_name("serd.launch.py")))
    return shared["description_of"]("learn")
