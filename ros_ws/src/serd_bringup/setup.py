# Copyright 2026 The SERD developers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""
Launch files, parameters and layouts of the nodes of serd_ros.

A launch file for each stack is made of one, which starts the stack of its own name.
"""

from pathlib import Path
from shutil import copyfile

from setuptools import setup

PACKAGE = 'serd_bringup'
LAUNCH_FILES = (
    'demonstrate',
    'learn',
    'nav2',
    'navigate',
    'robot',
    'robot_nav2',
    'robot_people',
    'simulation',
    'teleop',
)
FOLDERS = ('config', 'rviz', 'foxglove')


def files(folder: str) -> list[str]:
    """Return the files of a folder."""
    return sorted(str(path) for path in Path(folder).glob('*') if path.is_file())


def launch_files() -> list[str]:
    """Return serd.launch.py and its copies, each of which starts the stack of its name."""
    general, folder = Path('launch/serd.launch.py'), Path('build/launch')
    folder.mkdir(parents=True, exist_ok=True)
    for name in LAUNCH_FILES:
        copyfile(general, folder / f'{name}.launch.py')
    return [str(general), *files(str(folder))]


setup(
    name=PACKAGE,
    version='0.4.0',
    description='Launch files, parameters and layouts of SERD',
    license='Apache-2.0',
    packages=[],
    zip_safe=False,
    extras_require={'test': ['pytest']},
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{PACKAGE}']),
        (f'share/{PACKAGE}', ['package.xml']),
        (f'share/{PACKAGE}/launch', launch_files()),
        *((f'share/{PACKAGE}/{folder}', files(folder)) for folder in FOLDERS),
    ],
)
