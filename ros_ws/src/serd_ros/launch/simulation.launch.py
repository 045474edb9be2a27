"""ros2 launch serd_ros simulation.launch.py seed:=3

The world in real time, driven by any publisher of intent, waypoint or cmd_vel_raw.
"""

from pathlib import Path
from runpy import run_path


def generate_launch_description():
    shared = run_path(str(Path(__file__).with_name("serd.launch.py")))
    return shared["description_of"]("live")
