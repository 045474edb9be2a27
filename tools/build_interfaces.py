"""Build the two navigation actions of nav2_msgs, which has no wheel.

    .venv/bin/python tools/build_interfaces.py

Runs the rosidl generators that the ROS wheels bring, compiles one extension module per package and
installs it into this Python's site-packages. A package that is installed already stays as it is.
Needs gcc and g++, and takes 20 s. A full ROS installation has the package.

The interfaces are those of ROS 2 Jazzy. Only rmw_fastrtps_cpp is supported, the middleware of the
wheels. Each extension module holds everything that a package's libraries hold otherwise.
"""

import importlib.util
import json
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path

import numpy
from rosidl_adapter import convert_to_idl
from rosidl_generator_c import generate_c
from rosidl_generator_py import generate_py
from rosidl_generator_type_description import generate_type_hash
from rosidl_typesupport_c import generate_c as generate_typesupport
from rosidl_typesupport_fastrtps_c import generate_typesupport_fastrtps_c
from rosidl_typesupport_introspection_c import generate_c as generate_introspection

_RESULT_AND_FEEDBACK = """---
uint16 NONE=0
uint16 error_code
---
geometry_msgs/PoseStamped current_pose
builtin_interfaces/Duration navigation_time
builtin_interfaces/Duration estimated_time_remaining
int16 number_of_recoveries
float32 distance_remaining
"""
_GOAL = "{}\nstring behavior_tree\n"
_TO_POSE = _GOAL.format("geometry_msgs/PoseStamped pose") + _RESULT_AND_FEEDBACK
_THROUGH_POSES = _GOAL.format("geometry_msgs/PoseStamped[] poses") + _RESULT_AND_FEEDBACK
_THROUGH_POSES += "int16 number_of_poses_remaining\n"
INTERFACES = {
    "nav2_msgs": {
        "action/NavigateToPose.action": _TO_POSE,
        "action/NavigateThroughPoses.action": _THROUGH_POSES,
    }
}
_SUPPORT = "rosidl_typesupport_fastrtps_c"
_INTROSPECTION = "rosidl_typesupport_introspection_c"
_PARTS = "rosidl_generator_c", "rosidl_generator_py", "rosidl_typesupport_c"
_MESSAGES = "builtin_interfaces", "geometry_msgs", "std_msgs", "unique_identifier_msgs"
_DEPENDENCIES = ("action_msgs", "service_msgs", *_MESSAGES)
_LIBRARIES = (
    *(f"{name}__{part}" for name in _DEPENDENCIES for part in (*_PARTS, _SUPPORT, _INTROSPECTION)),
    *("rosidl_runtime_c", "rosidl_typesupport_c", _SUPPORT, f"{_SUPPORT}pp", _INTROSPECTION),
    *("rmw", "fastcdr", "rcutils"),
)
#: The first one's folder gets the headers that control visibility.
_GENERATORS: dict[str, Callable[[str], object]] = {
    "rosidl_generator_c": partial(generate_c, disable_description_codegen=False),
    _SUPPORT: generate_typesupport_fastrtps_c,
    _INTROSPECTION: generate_introspection,
    "rosidl_typesupport_c": partial(generate_typesupport, type_supports=[_SUPPORT, _INTROSPECTION]),
    "rosidl_generator_py": partial(generate_py, typesupport_impls=["rosidl_typesupport_c"]),
}
PREFIX = Path(sys.prefix)


def main() -> int:
    """Build and install what is missing."""
    header = Path(sysconfig.get_paths()["include"]) / "Python.h"
    missing = [each for each in ("gcc", "g++") if shutil.which(each) is None]
    missing += [] if header.exists() else [str(header)]
    if missing:
        needed = f"the interfaces are compiled, which needs {', '.join(missing)}"
        print(f"{needed}; run: apt-get install g++ python3-dev", file=sys.stderr)
        return 2
    for package, files in INTERFACES.items():
        if importlib.util.find_spec(package) is not None:
            print(f"{package}: installed already")
            continue
        with tempfile.TemporaryDirectory() as folder:
            _build(package, files, Path(folder))
        print(f"{package}: built and installed")
    return 0


def _build(package: str, files: dict[str, str], folder: Path) -> None:
    interfaces, python = folder / package, folder / "rosidl_generator_py" / package
    idl_files = _write_interfaces(package, files, interfaces)
    _generate(package, idl_files, folder)
    suffix = sysconfig.get_config_var("EXT_SUFFIX")
    extension = python / f"{package}_s__rosidl_typesupport_c{suffix}"
    _compile(package, folder, extension)
    site = Path(sysconfig.get_paths()["purelib"]) / package
    (python / "__init__.py").touch()
    # Renamed when it is complete: what was interrupted is not taken for installed.
    partial_site = site.with_name(f"{package}.partial")
    shutil.rmtree(partial_site, ignore_errors=True)
    _copy([*python.rglob("*.py"), extension], python, partial_site)
    described = [interfaces / each for each in (*files, *idl_files)]
    described += [each.with_suffix(".json") for each in described]
    _copy(filter(Path.exists, described), interfaces, PREFIX / "share" / package)
    partial_site.rename(site)


def _write_interfaces(package: str, files: dict[str, str], folder: Path) -> list[str]:
    """The names of the .idl files made from the interfaces, relative to the folder."""
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    made = [convert_to_idl(folder, package, Path(name), folder) for name in files]
    return [str(each.relative_to(folder)) for each in made]


def _generate(package: str, idl_files: list[str], folder: Path) -> None:
    """Run each generator into a folder of its own, since some of their files have one name."""
    interfaces = folder / package

    def arguments(generator: str, output: Path, **more: object) -> str:
        for name in idl_files:
            (output / name).parent.joinpath("detail").mkdir(parents=True, exist_ok=True)
        values = {
            "package_name": package,
            "output_dir": str(output),
            "template_dir": str(PREFIX / "share" / generator / "resource"),
            "idl_tuples": [f"{interfaces}:{name}" for name in idl_files],
            "target_dependencies": [],
            **more,
        }
        (written := folder / f"{generator}.json").write_text(json.dumps(values))
        return str(written)

    known = [f"{each}:{PREFIX / 'share' / each}" for each in _DEPENDENCIES]
    hashing = "rosidl_generator_type_description"
    generate_type_hash(arguments(hashing, interfaces, include_paths=known))
    hashes = [f"{each}:{interfaces / Path(each).with_suffix('.json')}" for each in idl_files]
    for generator, generate in _GENERATORS.items():
        output = folder / generator / package
        generate(arguments(generator, output, type_description_tuples=hashes))


def _compile(package: str, folder: Path, extension: Path) -> None:
    """The library of the type supports and, linked with it, the extension module.

    rosidl_typesupport_c loads a library by the name of each type support; here both are one.
    """
    generated = [folder / each for each in _GENERATORS if each != "rosidl_generator_py"]
    _write_visibility_headers(package, generated[0] / package / "msg")
    roots = [*generated, Path(numpy.get_include()), Path(sysconfig.get_paths()["include"])]
    roots += [PREFIX / "include", *sorted((PREFIX / "include").iterdir())]
    flags = ["-O1", "-fPIC", "-w", *(f"-I{each}" for each in roots)]

    def link(target: Path, sources: Iterable[Path], *more: str) -> None:
        objects = [_compiled(source, flags) for source in sources]
        libraries = [f"-L{PREFIX / 'lib'}", *(f"-l{name}" for name in _LIBRARIES), *more]
        subprocess.run(["g++", "-shared", "-o", target, *objects, *libraries], check=True)

    name = f"{package}__{_SUPPORT}"
    sources = (each for root in generated for each in root.rglob("*.c*"))
    link(PREFIX / "lib" / f"lib{name}.so", sources)
    twin = PREFIX / "lib" / f"lib{package}__{_INTROSPECTION}.so"
    twin.unlink(missing_ok=True)
    twin.symlink_to(f"lib{name}.so")
    link(extension, extension.parent.rglob("*.c"), f"-l{name}")


def _compiled(source: Path, flags: Sequence[str]) -> Path:
    compiler = ["g++", "-std=c++17"] if source.suffix == ".cpp" else ["gcc", "-std=gnu11"]
    target = source.with_suffix(f"{source.suffix}.o")
    subprocess.run([*compiler, *flags, "-c", source, "-o", target], check=True)
    return target


def _write_visibility_headers(package: str, folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for generator in ("rosidl_generator_c", _INTROSPECTION, _SUPPORT):
        name = f"{generator}__visibility_control.h"
        text = (PREFIX / "share" / generator / "resource" / f"{name}.in").read_text()
        for variable, value in (("PROJECT_NAME_UPPER", package.upper()), ("PROJECT_NAME", package)):
            text = text.replace(f"@{variable}@", value)
        (folder / name).write_text(text)


def _copy(files: Iterable[Path], origin: Path, target: Path) -> None:
    for each in files:
        copied = target / each.relative_to(origin)
        copied.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(each, copied)


if __name__ == "__main__":
    sys.exit(main())
