"""Recordings with wrong stamps lose no decision, as log times are those of receipt."""

import numpy as np
import pytest

from serd_app.demonstrations.discretise import demonstrations_of_drives
from serd_app.demonstrations.fitted_grid import grid_around
from serd_app.drives.mapped import mapped_drive_in
from serd_app.drives.mapping import BagMapping
from serd_app.drives.sessions import read_drives
from serd_bag.messages.plain import message_stamp_ns
from serd_bag.messages.times import RecordingClock
from serd_bag.reader import BagReader
from serd_bag.recorder import BagRecorder, RecorderSettings
from support.bag_messages import OWN_TOPICS, POSE, TWIST

START_S = 1_700_000_000.0
TOPICS = OWN_TOPICS | {"/cmd_vel": TWIST, "/other": POSE}
FAULTS = {
    "an hour ahead": lambda time_s: time_s + 3600.0,
    "an hour behind": lambda time_s: time_s - 3600.0,
    "zero": lambda _: 0.0,
    "backwards": lambda time_s: START_S - 3.0 * (time_s - START_S),
    "an hour ahead for a while": lambda t: t + (3600.0 if t > START_S + 15.0 else 0.0),
}
GRID = grid_around(np.array([[0.5, 0.5 + row] for row in range(11)]), 1.0)


@pytest.fixture
def record(tmp_path, messages):
    """Records 20 s of driving north, with wrong stamps on one topic, as the recorder node does."""

    def make(topic="", fault=None, paused_ticks=()):
        recorder = BagRecorder(
            tmp_path / f"{topic[1:]} {fault} {len(paused_ticks)}",
            settings=RecorderSettings(min_free_bytes=0, sync=False),
        )
        for name, kind in TOPICS.items():
            recorder.add_topic(name, kind)
        clock = RecordingClock(simulated=False)

        def send(name, time_s, encode, *values):
            stamp_s = FAULTS[fault](time_s) if name == topic else time_s
            data = encode(stamp_s, *values) if name != "/cmd_vel" else encode
            stamp_ns = message_stamp_ns(data) if name != "/cmd_vel" else 0
            received_ns = round((time_s + 0.002) * 1e9)
            times_ns = clock.times_ns(stamp_ns, received_ns, round((time_s + 0.001) * 1e9))
            assert recorder.record(name, data, *times_ns)

        command = messages.twist(0.5)
        send("/episode", START_S, messages.mark, "start", 0)
        for tick in range(201):
            time_s = START_S + 0.1 * tick
            recorder.paused = tick in paused_ticks
            send("/robot_pose", time_s, messages.pose, 0.5, 0.5 + 0.05 * tick)
            send("/other", time_s, messages.pose, 0.5, 0.5 + 0.05 * tick)
            send("/cmd_vel", time_s, command)
            if tick % 20 == 0 and tick < 200:
                send("/intent", time_s, messages.intent, 0.0, 1.0)
        send("/episode", START_S + 20.0, messages.mark, "end", 0, "arrived")
        recorder.close()
        return recorder.directory

    return make


def table_of(drives):
    return demonstrations_of_drives(drives, GRID, 4.0, 1.0)[0]


def decisions(drives):
    table = table_of(drives)
    return table.state.tolist(), table.action.tolist(), table.next_state.tolist()


MAPPING = BagMapping(
    action_from="velocity", action_topic="/cmd_vel", episode_topic="/episode", hold_s=0.2
)


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("topic", ["/robot_pose", "/intent", "/episode", "/other"])
def test_wrong_stamps_of_one_topic_cost_no_decision(record, topic, fault):
    sound, faulty = record(), record(topic, fault)
    expected = decisions(read_drives(sound))
    assert len(expected[0]) == 11  # ten cells are left, in the last one the drive ends
    assert decisions(read_drives(faulty)) == expected
    for message in BagReader(faulty).messages({"/cmd_vel"}):
        assert (message.log_time_ns - START_S * 1e9) % 1e8 == pytest.approx(2e6, abs=1e3)
    mapped = [decisions([mapped_drive_in(BagReader(bag), MAPPING)]) for bag in (sound, faulty)]
    assert len(mapped[0][0]) == 11
    assert mapped[0] == mapped[1]


def test_no_decision_goes_across_a_pause_of_the_recorder(record):
    """Pauses are shorter than a gap; a cell is entered in the first, an intent given in the other.

    The command before a pause may not be the one after it.
    """
    sound, bag = record(), record(paused_ticks=(71, 72, 73, 119, 120, 121))
    for read in (read_drives, lambda path: [mapped_drive_in(BagReader(path), MAPPING)]):
        (drive,) = read(bag)
        edges_s = [edge for span in drive.episodes for edge in (span.start_s, span.end_s)]
        assert np.subtract(edges_s, START_S) == pytest.approx([0, 7, 7.4, 11.8, 12.2, 20], abs=0.01)
        whole, paused = table_of(read(sound)), table_of([drive])
        ends_s = paused.time_s + paused.dwell_s
        for pause_s in (START_S + 7.2, START_S + 12.0):
            assert not ((paused.time_s < pause_s) & (pause_s < ends_s)).any()
        before, after = whole.time_s + whole.dwell_s < START_S + 7.0, whole.time_s > START_S + 14.1
        assert before.sum() >= 3
        assert after.sum() >= 3
        assert set(whole.time_s[before | after]) <= set(paused.time_s)
    begun_s = table_of(read_drives(bag)).time_s - START_S
    assert not ((begun_s > 12.1) & (begun_s < 13.9)).any()  # the next intent is of 14 s
