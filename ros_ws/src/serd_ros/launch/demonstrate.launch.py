"""ros2 launch serd_ros demonstrate.launch.py seed:=3 episodes:=5

The scripted expert drives, and its episodes are recorded.
"""

from pathlib import Path
from runpy import run_path


def generate_launch_description():
    shared = run_path(str(Path(__file__).with_name("serd.launch.py")))
    return shared["description_of"]("demonstrate")
