"""What reading one file may cost, whatever it holds: no size that a file declares is trusted.

Memory: a chunk, message or row larger than LARGEST_CONTENT is not read; at most three of that size
are in memory at once. Time: what a file unpacks to, and its number of records, are bounded by its
size, with ample room for real recordings.
"""

LARGEST_CONTENT = 64 << 20
#: Of one schema, channel or statistics record, and of all definitions of a file.
LARGEST_DEFINITION = 4 << 20
MOST_DEFINITIONS = 32 << 20
#: Lines in which the faults of a bag are reported.
MOST_FAULTS = 20
MOST_FAULTS_OF_A_FILE = 12
#: Of messages that are left out: no bag can hold such times.
WRONG_TIMES = "messages have times outside of 0 to 2^63-1 ns"


def most_unpacked(file_size: int) -> int:
    """Bytes to which a file may unpack."""
    return (512 << 20) + 25 * file_size


def most_records(file_size: int) -> int:
    """Records that are read of a file."""
    return 1_000_000 + file_size // 8
