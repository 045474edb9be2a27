"""`serd bag play` executes the node, and rejects a bag that cannot be played before that."""

import json
import sys

import pytest

from serd_cli.processes import stack_run


@pytest.fixture(autouse=True)
def looked_at(monkeypatch):
    """Topics that were required to have no publisher."""
    seen = []
    monkeypatch.setattr(stack_run, "require_free", lambda _, *names: seen.extend(names))
    return seen


@pytest.fixture
def started(monkeypatch):
    """Parameters and remappings of the node that would take the place of this process."""
    seen = []

    def command(node, parameters, remappings, _):
        seen.append((node, parameters, remappings))
        return ["/bin/true"]

    monkeypatch.setattr(stack_run, "node_command", command)
    monkeypatch.setattr(stack_run.os, "execve", lambda *_: None)
    return seen


def test_options_become_parameters_of_the_node(serd, drive_bag, started):
    bag = drive_bag()
    given = ["--rate", "10", "--start", "2", "--topic", "intent", "--wait-for", "learner"]
    ended = serd("bag", "play", bag, *given, "--remap", "intent:=other", "--no-clock")
    assert ended.code == 0, ended.err
    ((node, parameters, remappings),) = started
    assert (node, remappings) == ("bag_replay", {"intent": "other"})
    assert parameters["bag"] == str(bag.resolve())
    assert (parameters["rate"], parameters["start_s"], parameters["clock_hz"]) == (10.0, 2.0, 0.0)
    assert (parameters["topics"], parameters["required_nodes"]) == (("intent",), ("learner",))


@pytest.mark.parametrize(
    ("arguments", "topics"),
    [
        ([], ["/clock"]),
        (["--remap", "/clock:=/robot1/clock"], ["/robot1/clock"]),
        (["--no-clock"], []),
    ],
)
def test_a_clock_must_have_no_other_publisher(
    serd, drive_bag, started, looked_at, arguments, topics
):
    assert serd("bag", "play", drive_bag(), *arguments).code == 0
    assert looked_at == topics
    assert started


def test_with_json_the_result_is_printed_when_the_node_has_ended(serd, drive_bag, monkeypatch):
    code = "from serd_ros.process.progress import *; "
    code += "print('played 12 messages of a bag'); write_progress(Progress(text='', n_messages=12))"
    node = [sys.executable, "-c", code]
    monkeypatch.setattr(stack_run, "node_command", lambda *_: node)
    ended = serd("bag", "play", bag := drive_bag(), "--json")
    assert ended.code == 0, ended.err
    assert json.loads(ended.out) == {"bag": str(bag.resolve()), "messages": 12}
    assert "played 12 messages of a bag" in ended.err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--topic", "intnt"], "must hold the topic 'intnt'"),
        (["--topic", "intnt"], "did you mean '/intent'?"),
        (["--remap", "intent"], "--remap must be written FROM:=TO, got 'intent'"),
        (["--rate", "0"], "0"),
        (["--rate", "1e300"], "less than or equal to 1000000"),
        (["--rat", "2"], "--rate"),
    ],
)
def test_a_bag_that_cannot_be_played_is_rejected(serd, drive_bag, started, arguments, message):
    assert message in serd("bag", "play", drive_bag(), *arguments).refusal
    assert not started


def test_a_folder_without_a_bag_is_refused(serd, tmp_path, started):
    assert str(tmp_path) in serd("bag", "play", tmp_path).refusal
    assert not started
