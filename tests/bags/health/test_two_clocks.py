"""Stamps of another clock than the log times are named, late messages are not."""

import pytest

from serd_bag.health.check import check_bag
from support.bag_messages import POSE, write_bag


def ahead(offset_s):
    return lambda since_s: since_s + offset_s


def drifting(since_s):
    return 2.0 * since_s


def stalled(since_s):
    """The receiver waited from 20 to 22.5 s, and a message was 9 s late."""
    return 20.0 if 20.0 < since_s < 22.5 else since_s - 9.0 * (30.0 <= since_s < 30.05)


@pytest.mark.parametrize(
    ("clocks", "remark"),
    [
        ((ahead(0.0), ahead(3600.0)), "/1: stamps are 3600.00 s ahead of log times: the clock of"),
        ((ahead(0.0), ahead(-2.0)), "/1: stamps are 2.00 s behind log times: the clock of its"),
        ((ahead(0.0), drifting), "/1: stamps are 19.95 s ahead of log times: the clock of its"),
        ((ahead(-900.0), ahead(-900.5)), "all stamps are 900.00 s behind log times: those of"),
        ((ahead(0.0), stalled), "/1: stamps step back once"),
        ((ahead(0.0), ahead(0.9)), ""),
    ],
)
def test_check_reports_clocks_that_differ(tmp_path, messages, clocks, remark):
    rows = [
        (f"/{name}", 1000.0 + 0.1 * n, messages.pose(1000.0 + stamp_of(0.1 * n), 0.0, 0.0))
        for n in range(400)
        for name, stamp_of in enumerate(clocks)
    ]
    topics = {f"/{name}": POSE for name in range(len(clocks))}
    found = check_bag(write_bag(tmp_path / "bag", topics, rows)).remarks
    assert [each[: len(remark)] for each in found] == [remark] * bool(remark)
