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

"""What `colcon test` runs: launch files load."""

from pathlib import Path
import runpy

import pytest
from serd_ros.graph.graph import load_graph

PACKAGE = Path(__file__).resolve().parents[1]


@pytest.mark.parametrize('stack', sorted(load_graph().stacks))
def test_the_launch_file_describes_each_stack(stack, tmp_path):
    pytest.importorskip('launch_ros')
    text = (PACKAGE / 'launch' / 'serd.launch.py').read_text()
    file = tmp_path / f'{stack}.launch.py'
    file.write_text(text)
    described = runpy.run_path(str(file))['generate_launch_description']()
    assert described.entities
