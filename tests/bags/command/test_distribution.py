"""`serd-bag` as its own distribution: three dependencies, and nothing else is imported."""

import re
import shutil
import subprocess
import sys
import zipfile
from importlib.metadata import PackageNotFoundError, distribution, requires

import pytest

pytestmark = pytest.mark.slow

#: Refuses every import but those of some packages, then imports all modules and runs the command.
ALONE = """
import importlib, importlib.abc, pkgutil, sys
folder, allowed, *words = sys.argv[1:]
allowed = {"bags", "storage", "serd_core", *allowed.split(","), *sys.stdlib_module_names}

class Allowed(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] not in allowed:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

sys.meta_path.insert(0, Allowed())
sys.path.insert(0, folder)
import bags
assert bags.__file__.startswith(folder), bags.__file__
for module in pkgutil.walk_packages(bags.__path__, "bags."):
    importlib.import_module(module.name)
from bags.command.main import main
sys.exit(main(words))
"""


@pytest.fixture(scope="module")
def wheel(root, tmp_path_factory):
    """The unpacked distribution."""
    folder = tmp_path_factory.mktemp("wheel")
    options = ("--no-deps", "--no-build-isolation", "--quiet", "--wheel-dir", folder)
    # In a copy: a build leaves its modules beside the source, those of earlier versions too.
    ignored = shutil.ignore_patterns("build", "data", "__pycache__", "*.egg-info")
    for name in ("bags", "storage", "serd_core", "distributions"):
        shutil.copytree(root / name, folder / name, ignore=ignored)
    shutil.copy(root / "pyproject.toml", folder)
    source = folder / "distributions" / "serd-bag"
    subprocess.run([sys.executable, "-m", "pip", "wheel", *options, source], check=True)
    (file,) = folder.glob("serd_bag-*.whl")
    with zipfile.ZipFile(file) as archive:
        archive.extractall(folder / "unpacked")
    return folder / "unpacked"


def metadata_of(wheel):
    (file,) = wheel.glob("*.dist-info/METADATA")
    return file.read_text()


def with_dependencies(names):
    """Names of distributions and of all that they require here."""
    waiting, found = list(names), set()
    while waiting:
        name = waiting.pop().lower()
        if name not in found:
            found.add(name)
            lines = [line for line in requires(name) or () if "extra ==" not in line]
            waiting += [re.match(r"[\w.-]+", line)[0] for line in lines if installed(line)]
    return found


def installed(line):
    try:
        return distribution(re.match(r"[\w.-]+", line)[0])
    except PackageNotFoundError:
        return None


def modules_of(name):
    """Importable names of a distribution, as `packages_distributions` of Python 3.11 finds them."""
    return {file.parts[0].partition(".")[0] for file in distribution(name).files}


def test_it_has_three_dependencies_and_the_version_of_the_project(wheel, root):
    metadata = metadata_of(wheel)
    needed = re.findall(r"^Requires-Dist: ([\w-]+)", metadata, re.MULTILINE)
    assert sorted(needed) == ["PyYAML", "mcap", "rosbags"]
    version = re.search(r"^Version: (.+)$", metadata, re.MULTILINE)[1]
    assert f'version = "{version}"' in (root / "pyproject.toml").read_text()


def test_it_has_every_module_of_bags_and_no_recordings(wheel, root):
    ours = {path.relative_to(root) for path in (root / "bags").rglob("*.py")}
    theirs = {path.relative_to(wheel) for path in (wheel / "bags").rglob("*.py")}
    assert theirs == ours
    assert not list(wheel.rglob("*.mcap"))


def test_it_works_with_its_dependencies_alone(wheel, small_bag):
    wanted = with_dependencies(["mcap", "rosbags", "PyYAML"])
    allowed = set().union(*map(modules_of, wanted))
    assert not allowed & {"pydantic", "typer", "rich", "scipy", "rclpy", "pandas"}
    words = (str(wheel), ",".join(allowed), "check", str(small_bag()))
    ended = subprocess.run(
        [sys.executable, "-c", ALONE, *words], capture_output=True, text=True, cwd=wheel.parent
    )
    assert ended.returncode == 0, ended.stderr
    assert "sound: " in ended.stdout
