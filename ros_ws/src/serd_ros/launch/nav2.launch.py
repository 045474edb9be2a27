"""ros2 launch serd_ros nav2.launch.py model:=model.yaml

Nav2 drives the simulated robot to the waypoints of the learned policy; Nav2 is started apart.
"""

from pathlib import Path
from runpy import run_path


def generate_launch_description():
    shared = run_path(str(Path(__file__).with_name("serd.launch.py")))
    return shared["description_of"]("nav2")
