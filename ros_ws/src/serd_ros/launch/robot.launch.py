"""ros2 launch serd_ros robot.launch.py scenario:=depot-scenario.yaml model:=model.yaml

The learned policy drives a robot without the simulator.
"""

from pathlib import Path
from runpy import run_path


def generate_launch_description():
    shared = run_path(str(Path(__file__).with_name("serd.launch.py")))
    return shared["description_of"]("robot")
