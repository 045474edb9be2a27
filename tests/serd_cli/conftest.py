"""The command as a person types it, and small recordings to give it."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from serd_bag.reader import BagReader
from serd_bag.writer import BagWriter
from support.bag_messages import DIAGNOSTICS, POSE, VECTOR, Messages
from support.commands import Ended, run_serd, work_in_empty_folder
from support.foreign_bags import ForeignBag, Robot, key_presses
from support.people_messages import CLOUD, PeopleMessages

_MADE, _PEOPLE = Messages(), PeopleMessages()
#: Places and velocities of people.
_WALKERS = np.array([[4.5, 8.5], [1.5, 8.5]]), np.array([[0.0, 1.0], [1.0, 0.0]])
_START_S = 100.0
_STEP_S = 0.1


@pytest.fixture(autouse=True)
def _pictures(quick_pictures: None) -> None:
    """Commands draw several."""


@pytest.fixture
def serd(monkeypatch, capsys, tmp_path) -> Callable[..., Ended]:
    """Runs `serd` with some words in an empty folder."""
    work_in_empty_folder(monkeypatch, tmp_path)
    return lambda *words: Ended(run_serd(*words), *capsys.readouterr())


def write_drive(folder, *, intents=True, x_m=4.5, pose="/robot_pose", intent="/intent"):
    """A bag of a robot that drives north one cell per decision, for five decisions."""
    with BagWriter(folder) as writer:
        writer.add_topic(pose, POSE)
        writer.add_topic(intent, VECTOR)
        writer.add_topic("/episode", DIAGNOSTICS)
        writer.write("/episode", _mark(_START_S, "start"), _ns(_START_S))
        for step in range(101):
            time_s = _START_S + _STEP_S * step
            writer.write(pose, _MADE.pose(time_s, x_m, 1.5 + 0.05 * step), _ns(time_s))
            if intents and step % 20 == 0 and step < 100:
                writer.write(intent, _MADE.intent(time_s, 0.0, 1.0), _ns(time_s))
            if step % 10 == 9:
                writer.flush()
        writer.write("/episode", _mark(time_s, "end"), _ns(time_s))
    return folder


def copied_bag(bag, target, kept=None, people=()):
    """A copy with the messages that are kept, and with people at some times."""
    messages, topics = [*filter(kept, BagReader(bag).messages())], BagReader(bag).topics
    with BagWriter(target) as writer:
        for name in sorted({message.topic for message in messages}):
            writer.add_topic(name, topics[name].type_name)
        for message in messages:
            writer.write(message.topic, message.data, message.log_time_ns)
        if len(people):
            writer.add_topic("/pedestrians", CLOUD)
        for time_s in people:
            writer.write("/pedestrians", _PEOPLE.encode(CLOUD, time_s, *_WALKERS), _ns(time_s))
    return target


@pytest.fixture
def drive_bag(tmp_path) -> Callable[..., Path]:
    """Makes a bag of a drive, by its name."""
    return lambda name="drive", **options: write_drive(tmp_path / name, **options)


@pytest.fixture
def people_bag(drive_bag, tmp_path) -> Path:
    """A drive during which one person walks north and another across the hallway to the east."""
    times_s = _START_S + _STEP_S * np.arange(30)
    return copied_bag(drive_bag("before"), tmp_path / "people", people=times_s)


@pytest.fixture
def key_driven_bag(messages, tmp_path) -> Path:
    """A bag of a robot of another project that is driven by key presses."""
    commands = key_presses(np.random.default_rng(1))
    foreign = ForeignBag(messages)
    foreign.add_odometry("/odom", Robot().drive(commands, commands[-1][0] + 3.0))
    foreign.add_commands("/cmd_vel", commands)
    return foreign.write(tmp_path / "foreign")


def _ns(time_s: float) -> int:
    return round(time_s * 1e9)


def _mark(time_s: float, event: str) -> bytes:
    outcome = "arrived" if event == "end" else ""
    return _MADE.mark(time_s, event, 0, outcome, driver="anna", seed="1", start_area="train")
