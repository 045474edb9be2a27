"""The colcon package: the project's Python packages (linked here) and one executable per node."""

from pathlib import Path

from setuptools import find_packages, setup

PACKAGE = "serd_ros"
NODES = sorted(path.stem for path in Path("serd_ros/nodes").glob("*.py") if path.stem != "__init__")


def files(folder: str) -> list[str]:
    return sorted(str(path) for path in Path(folder).glob("*") if path.is_file())


setup(
    name=PACKAGE,
    version="0.2.0",
    description="Hallway navigation that learns rewards and dynamics from demonstrations (SERD)",
    license="Apache-2.0",
    packages=find_packages(exclude=["test", "tests"]),
    package_data={
        "": [
            "py.typed",
            "*.pyi",
            "*.yaml",
            "scenarios/*.yaml",
            "scenarios/*/*.yaml",
            "templates/*",
            "data/*",
            "static/*",
            "*.xml",
            "*.urdf",
        ]
    },
    include_package_data=True,
    zip_safe=False,
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
        (f"share/{PACKAGE}/launch", files("launch")),
        (f"share/{PACKAGE}/config", files("config")),
        (f"share/{PACKAGE}/rviz", files("rviz")),
        (f"share/{PACKAGE}/foxglove", files("foxglove")),
    ],
    entry_points={
        "console_scripts": [f"{node} = serd_ros.process.executable:main" for node in NODES],
    },
)
