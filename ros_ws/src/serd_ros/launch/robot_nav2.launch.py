"""ros2 launch serd_ros robot_nav2.launch.py scenario:=depot-scenario.yaml model:=model.yaml

The robot's own Nav2 drives to the waypoints of the learned policy.
"""

from pathlib import Path
from runpy import run_path


def generate_launch_description():
    shared = run_path(str(Path(__file__).with_name("serd.launch.py")))
    return shared["description_of"]("robot_nav2")
