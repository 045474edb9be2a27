"""The generated files are those of the present settings models."""

import runpy
from pathlib import Path

import yaml

from serd_app.drives.mapping import BagMapping, TableMapping
from serd_ros.graph.graph import config_of, load_graph
from serd_ros.process.serd_node import validated

ROOT = Path(__file__).resolve().parents[2]


def test_the_committed_reference_is_the_generated_one():
    generated = runpy.run_path(str(ROOT / "tools" / "write_reference.py"))["files"]()
    for path, text in generated.items():
        assert path.read_text(encoding="utf-8") == text, f"run `make reference`: {path.name}"


def test_nodes_yaml_holds_the_defaults_of_every_node():
    content = yaml.safe_load((ROOT / "ros_ws/src/serd_bringup/config/nodes.yaml").read_text())
    assert set(content) == set(load_graph().nodes)
    for node, entry in content.items():
        given = validated(node, entry["ros__parameters"], config_of(node))
        assert given == validated(node, {}, config_of(node))


def test_each_document_of_the_mapping_keys_is_a_mapping_with_its_defaults():
    bag, table = yaml.safe_load_all((ROOT / "docs/mapping_keys.yaml").read_text(encoding="utf-8"))
    assert (BagMapping(**bag), TableMapping(**table)) == (BagMapping(), TableMapping())
    assert set(bag) == set(BagMapping.model_fields)
    assert set(table) == set(TableMapping.model_fields)
