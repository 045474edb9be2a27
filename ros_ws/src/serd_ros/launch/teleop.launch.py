"""ros2 launch serd_ros teleop.launch.py scenario:=hallway

A person drives through the web page, and it is recorded.
"""

from pathlib import Path
from runpy import run_path


def generate_launch_description():
    shared = run_path(str(Path(__file__).with_name("serd.launch.py")))
    return shared["description_of"]("teleop")
