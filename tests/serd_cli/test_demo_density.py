"""The demo's learning with density, from a bag that also holds people."""

from pathlib import Path

import numpy as np

import bags
from bags.messages.plain import message_stamp_ns
from bags.reader import BagReader
from bags.writer import BagWriter
from serd_app.demonstrations.decision_table import load_decisions
from serd_app.demonstrations.grid.grid_file import load_grid
from serd_app.demonstrations.measured_density import load_density
from serd_app.demonstrations.recorded import report_of_table
from serd_app.navigation.evaluation.familiarity import familiarity_of
from serd_cli.demo.folder import DemoFolder, DemoSettings
from serd_cli.demo.phases import learn
from storage.model_file import load_model
from tests.serd_cli.conftest import CLOUD, _people

SHIPPED = Path(bags.__file__).parent / "data" / "hallway" / "training"


def test_a_demo_with_density_learns_it_from_the_people_of_its_bag(tmp_path):
    folder = DemoFolder(tmp_path)
    reader = BagReader(SHIPPED)
    with BagWriter(folder.bag) as writer:
        for topic in reader.topics.values():
            writer.add_topic(topic.name, topic.type_name)
        writer.add_topic("/pedestrians", CLOUD)
        for message in reader.messages():
            writer.write(message.topic, message.data, message.log_time_ns)
            if message.topic == "/intent":
                stamp_ns = message_stamp_ns(message.data)
                writer.write("/pedestrians", _people(stamp_ns / 1e9), message.log_time_ns)
    phase = learn(folder, DemoSettings(density=True), {})
    assert phase.name == "learn"
    assert load_model(folder.model).with_density
    assert folder.learned()
    decisions = load_decisions(folder.decisions)
    grid = load_grid(folder.decisions.with_suffix(".grid.yaml"))
    assert load_density(folder.decisions, grid, decisions).n_known == len(decisions) > 100
    assert report_of_table(folder.decisions).n_moves == len(decisions)
    # A bag is compared with the density of its own people.
    found = familiarity_of(folder.model, [folder.bag], n_simulated=5)
    assert len(found.decisions) == len(found.tails) == len(decisions)
    assert found.decisions.state.max() < grid.n_states
    assert np.isfinite(found.scores.log_likelihood).all()
