"""ros2 launch serd_ros navigate.launch.py model:=model.yaml

The learned policy drives, and times of arrival are measured.
"""

from pathlib import Path
from runpy import run_path


def generate_launch_description():
    shared = run_path(str(Path(__file__).with_name("serd.launch.py")))
    return shared["description_of"]("navigate")
