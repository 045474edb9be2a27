"""Files made to exhaust memory or time: little of both is used, and few lines report the faults.

Work is bounded by the records and bytes that are read; memory is the peak of a process of its own.
"""

import sqlite3
import struct
import subprocess
import sys
from contextlib import closing

import lz4.frame
import pytest
import zstandard
from mcap.records import Channel, Chunk, Message, Schema

from serd_bag.formats.limits import MOST_FAULTS, most_records, most_unpacked
from serd_bag.health.check import check_bag
from support.mcap_files import CONTENTS, Feature, encoded, mcap_file

_MOST_MEMORY_MB = 300
#: Prints faults, messages and peak memory (kB) of a check of each file, in a process of its own.
_CHECK = """
import os, re, sys
from pathlib import Path
from serd_bag.health.check import check_bag
for path in sys.argv[1:]:
    if not os.fork():
        found = check_bag(path)
        peak = re.search(r"VmHWM:\\s*(\\d+)", Path("/proc/self/status").read_text())[1]
        print(len(found.faults), found.n_messages, peak, flush=True)
        os._exit(0)
    os.wait()
"""


HEAD = mcap_file([], Feature.NONE)[:25]
BEGINNING = HEAD + b"".join(map(encoded, CONTENTS["OneMessage"][:2]))


def zeros(size):
    """A zstd frame of that many zeros, in blocks of 4 bytes each."""
    n_blocks = size >> 17
    blocks = b"".join(
        ((1 << 17) << 3 | 1 << 1 | (number == n_blocks - 1)).to_bytes(3, "little") + b"\0"
        for number in range(n_blocks)
    )
    return zstandard.FRAME_HEADER + b"\x00\x58" + blocks


def chunk(data, size, compression="zstd", checksum=0):
    return encoded(Chunk(compression, data, 1, 0, checksum, size))


def many_messages_of_no_size():
    message = encoded(Message(1, 1, b"", 1, 0)) * 100_000
    packed = zstandard.compress(message)
    return BEGINNING + chunk(packed, len(message)) * 100


def chunks_within_chunks_that_all_reach_to_the_end():
    size = 49 * 4000
    heads = b"".join(
        struct.pack("<BQQQQIIQ", 6, size - 49 * n - 9, 0, 0, 9, 1, 0, size - 49 * n - 49)
        for n in range(size // 49)
    )
    return BEGINNING + b"\0" + heads


def a_definition_of_empty_lines():
    schema = Schema(1, b"\n" * 37_000, "ros2msg", "a/msg/B")
    return HEAD + encoded(schema) + encoded(Channel(1, "/b", "cdr", {}, 1))


def quality_of_service(text):
    return BEGINNING + encoded(Channel(2, "/b", "cdr", {"offered_qos_profiles": text}, 1))


def quality_of_service_that_refers_to_itself():
    lines = (f"- &a{n + 1} {{<<: [*a{n}, *a{n}]}}\n" for n in range(40))
    return quality_of_service("- &a0 {x: 1}\n" + "".join(lines))


BOMBS = {
    "a chunk that unpacks to 2 GB": lambda: BEGINNING + chunk(zeros(2 << 30), 2 << 30),
    "a chunk that unpacks to more than it declares": lambda: BEGINNING + chunk(zeros(2 << 30), 100),
    "an lz4 chunk that unpacks to more than it declares": lambda: (
        BEGINNING + chunk(lz4.frame.compress(bytes(400 << 20)), 1 << 20, "lz4")
    ),
    "many chunks that unpack to 60 MB": lambda: BEGINNING + chunk(zeros(60 << 20), 60 << 20) * 100,
    "many messages of no size": many_messages_of_no_size,
    "many bad chunks": lambda: BEGINNING + chunk(b"\0", 1, "", checksum=1) * 100_000,
    "chunks within chunks": chunks_within_chunks_that_all_reach_to_the_end,
    "a definition of empty lines": a_definition_of_empty_lines,
    "nested quality of service": lambda: quality_of_service("[" * 37_000),
    "quality of service that refers to itself": quality_of_service_that_refers_to_itself,
}


@pytest.mark.slow
def test_little_memory_is_used_and_few_lines_report_the_faults(tmp_path):
    paths = [tmp_path / f"{name}.mcap" for name in BOMBS]
    for path, bomb in zip(paths, BOMBS.values(), strict=True):
        path.write_bytes(bomb())
    packed = tmp_path / "bomb.mcap.zstd"
    packed.write_bytes(zeros(8 << 30))
    assert packed.stat().st_size < 263_000
    assert most_unpacked(packed.stat().st_size) < 1 << 30
    command = [sys.executable, "-c", _CHECK, *paths, packed]
    output = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    for path, line in zip([*paths, packed], output.splitlines(), strict=True):
        n_faults, n_messages, peak_kb = map(int, line.split())
        assert 0 < n_faults <= MOST_FAULTS, path
        assert peak_kb / 1024 < _MOST_MEMORY_MB, path
        if path.stem == "many messages of no size":
            assert 900_000 < n_messages <= most_records(path.stat().st_size)


def test_equal_faults_are_one_line_with_their_number(tmp_path):
    path = tmp_path / "bomb.mcap"
    path.write_bytes(BEGINNING + chunk(b"\0", 1, "", checksum=1) * 300)
    faults = check_bag(path).faults
    assert len(faults) == 1
    assert "checksum of a chunk does not fit its content (the first of 300 such" in faults[0]


@pytest.mark.parametrize(
    "table",
    [
        "CREATE VIEW messages AS WITH RECURSIVE n(id) AS (SELECT 1 UNION ALL SELECT id + 1 FROM n)"
        " SELECT id, 1 AS topic_id, id AS timestamp, x'00' AS data FROM n",
        "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER,"
        " data AS (zeroblob(1000000000)))",
    ],
)
def test_a_table_that_is_computed_is_not_read(tmp_path, table):
    path = tmp_path / "bomb.db3"
    with closing(sqlite3.connect(path)) as connection:
        connection.execute(table)
        connection.execute(
            "CREATE TABLE topics(id INTEGER PRIMARY KEY, name, type, serialization_format)"
        )
        connection.execute("INSERT INTO topics VALUES (1, '/a', 'std_msgs/msg/String', 'cdr')")
        connection.commit()
    faults = check_bag(path).faults
    assert any("no plain table 'messages'" in each for each in faults)


def test_a_message_that_unpacks_to_more_than_may_be_read_is_a_fault(tmp_path):
    path = tmp_path / "bomb.mcap"
    message = Message(1, 1, zeros(1 << 30), 1, 0)
    channel = Channel(1, "/b", "cdr", {}, 0)
    path.write_bytes(HEAD + encoded(channel) + encoded(message))
    check = check_bag(path)
    assert any("1 compressed messages cannot be unpacked" in each for each in check.faults)
    assert check.n_messages == 0
