"""The log of arrivals: appended, whole after a kill."""

import os
import signal
import subprocess
import sys

from serd_app.navigation.arrival_log import ArrivalRow, append_arrival, load_arrivals


def row(episode):
    return ArrivalRow(
        episode, 3, 0.1 + 0.2, 1 / 3, 12.0, 18.0, "a, model.yaml", "arrived", "",
        0.99, 51.05, 1e-17, 48.9, 0.25,
    )  # fmt: skip


def test_rows_are_appended_and_survive_exactly(tmp_path):
    path = tmp_path / "new" / "arrivals.csv"
    rows = tuple(row(episode) for episode in range(3))
    for each in rows:
        append_arrival(path, each)
    assert load_arrivals(path) == rows


_WRITE_FOR_EVER = """
import sys
from itertools import count
from serd_app.navigation.arrival_log import ArrivalRow, append_arrival
for episode in count():
    append_arrival(sys.argv[1], ArrivalRow(episode, 1, *[0.0] * 4, "m", "arrived", "", *[1.0] * 5))
    print(episode, flush=True)
"""


def test_what_was_told_before_a_kill_is_there_after_it(tmp_path):
    path = tmp_path / "arrivals.csv"
    command = [sys.executable, "-c", _WRITE_FOR_EVER, str(path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        for line in process.stdout:
            if int(line) >= 20:
                break
        os.kill(process.pid, signal.SIGKILL)
    episodes = [each.episode for each in load_arrivals(path)]
    assert episodes == list(range(len(episodes)))
    assert len(episodes) > 20
