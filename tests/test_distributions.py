"""The distributions serd-core, serd-bag and serd: who owns which file, and what each needs."""

import re
import shutil
import subprocess
import sys
import zipfile
from importlib.metadata import PackageNotFoundError, distribution, requires
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

#: Project folder and packages of each distribution.
PROJECTS = {
    "serd-core": ("serd_core", ("serd_core",)),
    "serd-bag": ("bags", ("bags/serd_bag",)),
    "serd": (".", ("serd_files", "sim/serd_sim", "serd_app", "serd_ros", "serd_cli")),
}
#: Refuses every import but those of some packages, then imports all modules and runs a statement.
ALONE = """
import importlib, importlib.abc, importlib.util, pkgutil, sys
folder, package, allowed, statement = sys.argv[1:]
allowed = {package, *allowed.split(","), *sys.stdlib_module_names}

class Allowed(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] not in allowed and not name.startswith("_sysconfigdata"):
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

sys.meta_path.insert(0, Allowed())
really = importlib.util.find_spec  # by which optional libraries are looked for
importlib.util.find_spec = lambda name: really(name) if name.partition(".")[0] in allowed else None
sys.path.insert(0, folder)
root = importlib.import_module(package)
assert root.__file__.startswith(folder), root.__file__
for module in pkgutil.walk_packages(root.__path__, f"{package}."):
    importlib.import_module(module.name)
exec(statement)
"""


@pytest.fixture(scope="module")
def unpacked(root, tmp_path_factory):
    """Folder of each unpacked wheel, built in a copy: a build leaves its modules beside the source.

    No file belongs to two, so that whichever is removed the others keep theirs.
    """
    folder = tmp_path_factory.mktemp("wheels")
    tree = folder / "tree"
    ignored = shutil.ignore_patterns("build", "__pycache__", "*.egg-info")
    names = {"serd_core", "bags", "sim", "serd_files", "serd_app", "serd_ros", "serd_cli"}
    for name in names:
        shutil.copytree(root / name, tree / name, ignore=ignored)
    (tree / "docs").mkdir()
    for file in ("pyproject.toml", "LICENSE", "docs/package.md"):
        shutil.copy(root / file, tree / file)
    options = ("--no-deps", "--no-build-isolation", "--quiet", "--wheel-dir", folder)
    projects = [tree / project for project, _ in PROJECTS.values()]
    subprocess.run([sys.executable, "-m", "pip", "wheel", *options, *projects], check=True)
    for name in PROJECTS:
        file = next(folder.glob(f"{name.replace('-', '_')}-[0-9]*.whl"))
        with zipfile.ZipFile(file) as archive:
            archive.extractall(folder / name)
    return {name: folder / name for name in PROJECTS}


def metadata_of(wheel):
    return next(wheel.glob("*.dist-info/METADATA")).read_text()


def files_in(folder):
    """Files of a package that a wheel must have, relative to the folder of the package."""
    left_out = {"__pycache__", "build", "serd_core.egg-info"}
    return {
        path.relative_to(folder.parent)
        for path in folder.rglob("*")
        if path.is_file() and not left_out & set(path.parts)
    }


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


def importable_names(name):
    """Importable names of a distribution, as `packages_distributions` of Python 3.11 finds them."""
    return {file.parts[0].partition(".")[0] for file in distribution(name).files}


def required_by(wheel):
    lines = re.findall(r"^Requires-Dist: ([\w-]+)([^\n]*)", metadata_of(wheel), re.MULTILINE)
    return {name: rest for name, rest in lines if "extra ==" not in rest}


def test_each_has_every_file_of_its_packages_and_no_recordings(unpacked, root):
    of_project = {Path("serd_core", each) for each in ("pyproject.toml", "README.md", "LICENSE")}
    for name, (_, packages) in PROJECTS.items():
        for package in packages:
            ours = files_in(root / package) - of_project
            theirs = files_in(unpacked[name] / Path(package).name)
            assert ours <= theirs, sorted(map(str, ours - theirs))
        assert not list(unpacked[name].rglob("*.mcap"))
        assert list(unpacked[name].glob("*.dist-info/licenses/LICENSE"))


def test_no_file_belongs_to_two_and_every_name_begins_with_serd(unpacked):
    files = [
        path.relative_to(wheel)
        for wheel in unpacked.values()
        for path in wheel.rglob("*")
        if path.is_file()
    ]
    assert len(files) == len(set(files))
    assert all(re.match(r"serd(_|-[0-9.]+\.dist-info)", file.parts[0]) for file in files)


def test_serd_requires_the_other_two_in_its_own_version(unpacked):
    versions = {
        name: re.search(r"^Version: (.+)$", metadata_of(wheel), re.MULTILINE)[1]
        for name, wheel in unpacked.items()
    }
    assert len(set(versions.values())) == 1
    needed = required_by(unpacked["serd"])
    assert {needed["serd-core"], needed["serd-bag"]} == {f"=={versions['serd']}"}


def test_the_libraries_need_little(unpacked):
    assert required_by(unpacked["serd-core"]).keys() == {"numpy", "scipy"}
    recordings = {"mcap", "rosbags", "lz4", "zstandard", "numpy", "PyYAML"}
    assert required_by(unpacked["serd-bag"]).keys() == recordings


@pytest.mark.parametrize(
    ("name", "package", "statement"),
    [
        ("serd-core", "serd_core", "import serd_core as sc; sc.fit_mdce_serd"),
        ("serd-bag", "serd_bag", "from serd_bag.command.main import main; main(['--help'])"),
    ],
)
def test_a_library_works_with_its_dependencies_alone(unpacked, name, package, statement):
    allowed = set().union(*map(importable_names, with_dependencies(required_by(unpacked[name]))))
    assert not allowed & {"pydantic", "typer", "rich", "rclpy", "pandas"}
    ended = subprocess.run(
        [sys.executable, "-c", ALONE, unpacked[name], package, ",".join(allowed), statement],
        capture_output=True,
        text=True,
        cwd=unpacked[name],
    )
    assert ended.returncode == 0, ended.stderr
