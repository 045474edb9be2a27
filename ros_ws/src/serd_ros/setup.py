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
The nodes: one executable for each.

The Python code is the distribution `serd`, installed beside it with pip; this package installs no
module.
"""

from importlib.resources import files as files_of

from setuptools import setup
import yaml

PACKAGE = 'serd_ros'
#: The nodes of the graph, by the distribution `serd` that this build finds.
NODES = sorted(yaml.safe_load((files_of('serd_ros') / 'graph/graph.yaml').read_text())['nodes'])

setup(
    name=PACKAGE,
    version='0.4.0',
    description='Hallway navigation that learns rewards and dynamics from demonstrations (SERD)',
    license='Apache-2.0',
    packages=[],
    zip_safe=False,
    extras_require={'test': ['pytest']},
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{PACKAGE}']),
        (f'share/{PACKAGE}', ['package.xml']),
    ],
    entry_points={
        'console_scripts': [f'{node} = serd_ros.process.executable:main' for node in NODES],
    },
)
