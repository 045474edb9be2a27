"""The place of a single wrong bit, by the CRC-32 of the bytes that it is among.

CRC-32 is linear: the difference of the checksums of two texts of one length is that of the wrong
bits alone. A wrong bit with k bytes behind it makes the difference S^k(T[bit]), where S is the step
of the checksum for a zero byte and T its table (RFC 1952, section 8). It is found from both sides:
a table for the last 2,048 bytes, and steps back of 2,048 bytes at once.
"""

from functools import cache

_POLYNOMIAL = 0xEDB88320
_BLOCK = 2048


def wrong_bit(length: int, difference: int) -> tuple[int, int] | None:
    """(place of the byte, its wrong bit as a mask) among `length` bytes; None for several bits.

    difference: checksum of the bytes as they are, exclusive or that of the right ones. Of damage
    to several bits one in 2^29 / length is taken for a single one.
    """
    places, back = _last_places(), _steps_back()
    for behind in range(0, length, _BLOCK):
        found = places.get(difference)
        if found is not None:
            place = length - 1 - behind - found[0]
            return (place, found[1]) if place >= 0 else None
        difference = (
            back[0][difference & 0xFF]
            ^ back[1][difference >> 8 & 0xFF]
            ^ back[2][difference >> 16 & 0xFF]
            ^ back[3][difference >> 24]
        )
    return None


@cache
def _table() -> tuple[int, ...]:
    rows = []
    for value in range(256):
        for _ in range(8):
            value = value >> 1 ^ (_POLYNOMIAL if value & 1 else 0)
        rows.append(value)
    return tuple(rows)


@cache
def _last_places() -> dict[int, tuple[int, int]]:
    """(bytes behind it, mask) of each bit of a block, by the difference that it makes."""
    table, places = _table(), {}
    for bit in range(8):
        difference = table[1 << bit]
        for behind in range(_BLOCK):
            places[difference] = behind, 1 << bit
            difference = difference >> 8 ^ table[difference & 0xFF]
    return places


@cache
def _steps_back() -> tuple[tuple[int, ...], ...]:
    """The step back over a block, for each value of each byte of a difference."""
    table = _table()
    of_high_byte = {entry >> 24: (entry, low) for low, entry in enumerate(table)}

    def back(difference: int) -> int:
        for _ in range(_BLOCK):
            entry, low = of_high_byte[difference >> 24]
            difference = (difference ^ entry) << 8 & 0xFFFFFFFF | low
        return difference

    of_bits = [back(1 << bit) for bit in range(32)]

    def combined(value: int, first_bit: int) -> int:
        result = 0
        for bit in range(8):
            if value >> bit & 1:
                result ^= of_bits[first_bit + bit]
        return result

    return tuple(
        tuple(combined(value, first_bit) for value in range(256)) for first_bit in (0, 8, 16, 24)
    )
