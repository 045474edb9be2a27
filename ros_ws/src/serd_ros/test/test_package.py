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

"""What `colcon test` runs: executables answer --help."""

import subprocess
import sys

import pytest
from serd_ros.graph.graph import load_graph

NODES = sorted(load_graph().nodes)


@pytest.mark.parametrize('node', NODES)
def test_an_executable_answers_help_with_its_parameters(node):
    module = [sys.executable, '-m', 'serd_ros.process.executable']
    done = subprocess.run([*module, node, '--help'], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert f'{node}: ' in done.stdout
    assert '  -p ' in done.stdout
