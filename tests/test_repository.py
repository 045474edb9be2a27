"""Files around the code, as for CI and ROS: valid, and in agreement."""

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest
import rclpy.lifecycle.node
import yaml
from catkin_pkg.package import parse_package

from serd_ros.endpoints.topic_types import TYPES, topic_type

try:
    import tomllib
except ModuleNotFoundError:
    import tomli as tomllib


def test_ci_runs_its_script_on_each_supported_python(root):
    workflow = yaml.safe_load((root / ".github/workflows/ci.yml").read_text())
    (job,) = workflow["jobs"].values()
    project = tomllib.loads((root / "pyproject.toml").read_text())["project"]
    named = [each.rpartition(" :: ")[2] for each in project["classifiers"] if ":: 3." in each]
    assert job["strategy"]["matrix"]["python"] == named
    assert any(".ci/run" in step.get("run", "") for step in job["steps"])


@pytest.mark.parametrize("name", ["serd_ros", "serd_bringup"])
def test_a_ros_package_is_valid_and_complete_in_its_folder(root, name):
    folder, warnings = root / "ros_ws/src" / name, []
    package = parse_package(str(folder), warnings=warnings)
    assert not warnings
    assert package.get_build_type() == "ament_python"
    (license,) = package.licenses
    assert (folder / license.file).read_bytes() == (root / "LICENSE").read_bytes()
    assert f"\n{package.version} (" in (folder / "CHANGELOG.rst").read_text(encoding="utf-8")
    keys = [each.name for each in package.exec_depends]
    assert len(keys) == len(set(keys))


def test_ros_packages_depend_on_what_nodes_launch_files_and_topics_use(root):
    folders = [root / "ros_ws/src" / name for name in ("serd_ros", "serd_bringup")]
    nodes, launch_files = root.glob("serd_ros/**/*.py"), folders[1].glob("launch/*.py")
    texts = [path.read_text(encoding="utf-8") for path in (*nodes, *launch_files)]
    used = {name for text in texts for name in imported_packages(text)}
    ours = (path.name for each in (".", "sim", "bags") for path in (root / each).iterdir())
    used -= {*sys.stdlib_module_names, *ours}
    used |= {name for text in texts for name in re.findall(r'ros_type\("(\w+)\.', text)}
    kinds = [topic_type(topic, stamped_cmd_vel=False) for topic in TYPES]
    used |= {kind.name.partition("/")[0] for kind in kinds}
    assert {"rclpy", "launch", "launch_ros", "nav2_msgs", "tf2_msgs", "yaml"} <= used
    depends = [each for folder in folders for each in parse_package(str(folder)).exec_depends]
    keys = {each.name.removesuffix("-pip") for each in depends}
    assert {name for name in used if not {name, f"python3-{name}"} & keys} == set()


def imported_packages(text):
    """First names of the modules that a file imports."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            yield from (alias.name.partition(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield node.module.partition(".")[0]


@pytest.mark.parametrize("linter", ["ament_flake8", "ament_pep257"])
def test_ros_packages_are_clean_by_the_linters_of_ament(linter, root):
    done = subprocess.run(
        [sys.executable, "-m", f"{linter}.main", "."],
        cwd=root / "ros_ws/src",
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_each_file_of_ros_packages_begins_with_the_licence_as_those_of_ros_do(root):
    """ament_copyright, which no wheel has, compares with the same text."""

    def after_owner(path):
        first, *others = path.read_text(encoding="utf-8").splitlines()
        assert re.fullmatch(r"# Copyright 20\d\d .+", first)
        return others[:12]

    expected = after_owner(Path(rclpy.lifecycle.node.__file__))
    assert expected[-1] == "# limitations under the License."
    found = list((root / "ros_ws/src").rglob("*.py"))
    assert len(found) >= 3
    for path in found:
        assert after_owner(path) == expected, path
