"""The log of arrivals: appended, exact, and whole after a kill."""

import os
import signal
import subprocess
import sys

from serd_app.navigation.navigator import ArrivalRow, append_arrival, load_arrivals


def test_rows_are_appended_and_survive_exactly(tmp_path):
    path = tmp_path / "new" / "arrivals.csv"
    places, law = (0.1 + 0.2, 1 / 3, 12.0, 18.0), (0.99, 51.05, 1e-17, 48.9, 0.25)
    rows = tuple(ArrivalRow(i, 3, *places, "a, model", "arrived", "", *law) for i in range(3))
    for row in rows:
        append_arrival(path, row)
    assert load_arrivals(path) == rows


_WRITE_FOR_EVER = """
import sys
from itertools import count
from serd_app.navigation.navigator import ArrivalRow, append_arrival
for episode in count():
    append_arrival(sys.argv[1], ArrivalRow(episode, 1, *[0.0] * 4, "m", "arrived", "", *[1.0] * 5))
    print(episode, flush=True)
"""


def test_what_was_written_before_a_kill_is_there_after_it(tmp_path):
    path = tmp_path / "arrivals.csv"
    command = [sys.executable, "-c", _WRITE_FOR_EVER, str(path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert any(int(line) >= 20 for line in process.stdout)
        os.kill(process.pid, signal.SIGKILL)
    episodes = [row.episode for row in load_arrivals(path)]
    assert episodes == list(range(len(episodes)))
    assert len(episodes) > 20
