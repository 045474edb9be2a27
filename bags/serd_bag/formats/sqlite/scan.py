"""All messages of one .db3 file (SQLite, the storage before MCAP), sound or damaged.

A sound file is read through SQLite in the order it was written. SQLite has no checksums: a file it
finds sound may hold flipped bits within messages. Of a damaged file each page is read.

rosbags' reader is not used here: it rejects files whose quality of service or message definitions
it cannot parse, and sorts by log time, which would mix the runs of a clock that was set back.
"""

import mmap
import shutil
import sqlite3
import tempfile
from collections import Counter
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager, suppress
from pathlib import Path
from typing import TypeVar

from serd_bag.damage import FileScan, Stated
from serd_bag.errors import BagError, DamagedBagError, disk_errors
from serd_bag.formats.limits import LARGEST_MESSAGE
from serd_bag.formats.sqlite.pages import SqlitePages
from serd_bag.topic import QOS, ROS2MSG, TYPE_HASH, Channel, RawMessage, Record

#: What SQLite keeps beside a file that was not closed.
_UNFINISHED = ("-wal", "-journal")

#: topic number, log time, data
_Row = tuple[int, int, bytes]
_MAKE = tuple.__new__
_Message = TypeVar("_Message", Record, RawMessage)
_UNSIGNED = (1 << 64) - 1
_BLOCK = 1 << 20


class SqliteScan(FileScan):
    """One pass through one .db3 file; thorough: let SQLite check the whole file first, else only
    what it reads."""

    def __init__(
        self, path: Path, start: int = 0, end: int | None = None, *, thorough: bool = False
    ) -> None:
        super().__init__(path, start, end)
        self._thorough = thorough

    def stated(self) -> Stated | None:
        """Contents by rows that SQLite counts without their data."""
        query = "SELECT topic_id, COUNT(*), MIN(timestamp), MAX(timestamp) FROM messages"
        with self._database() as (path, database), suppress(sqlite3.Error):
            if _fault(database, whole=False):
                return None
            known = _channels(path, database)
            rows = database.execute(f"{query} GROUP BY topic_id").fetchall()
            counts = Counter({known[number].topic: n for number, n, *_ in rows if number in known})
            is_whole = counts.total() == sum(row[1] for row in rows) == _n_indexed(database)
            times_ns = [time_ns for row in rows for time_ns in row[2:]]
            if is_whole and all(time_ns.__class__ is int and time_ns >= 0 for time_ns in times_ns):
                types = {each.topic: each.type_name for each in reversed(known.values())}
                return Stated(types, counts, min(times_ns, default=0), max(times_ns, default=0))
        return None

    def channels(self) -> list[Channel]:
        """Channels of the file; of a damaged one those whose rows are left."""
        with self._database() as (path, database):
            found = _channels(path, database)
            if not found:
                self.log.note(None, _fault(database) or "it names no topic")
        return list(found.values())

    def records(
        self,
        topics: frozenset[str] | None = None,
        *,
        doubtful: bool = False,  # noqa: ARG002 (no row is: the format has no checksums)
    ) -> Iterator[Record]:
        """Messages of the given topics, None for all; publish times are the log times.

        A time below 0 has the number of the same 64 bits, as in MCAP files of rosbag2.
        """
        return self._made(Record, topics)

    def messages(self, topics: frozenset[str] | None) -> Iterator[RawMessage]:
        """The same as messages, which takes two thirds of the time of making them of records."""
        return self._made(RawMessage, topics)

    def _made(self, kind: type[_Message], topics: frozenset[str] | None) -> Iterator[_Message]:
        n_unknown = 0
        with self._database() as (path, database):
            fault = _fault(database, whole=self._thorough)
            if fault:
                self.log.note(None, fault)
            known = _channels(path, database)
            wanted = None
            if topics is not None:
                wanted = [number for number, each in known.items() if each.topic in topics]
            condition = "" if wanted is None else f" topic_id IN ({', '.join(map(str, wanted))})"
            if condition and not fault:
                self.counts.update(_counts(database, known, f" WHERE NOT{condition}"))
            n_read = dict.fromkeys(known, 0)
            heads: dict[int, tuple[object, object]] = {
                number: (each, 0) if kind is Record else (each.topic, each.type_name)
                for number, each in known.items()
            }
            rows = (
                self._salvaged(path, wanted, n_read) if fault else self._rows(database, condition)
            )
            with _reading(self.path):
                for number, time_ns, data in rows:
                    if data.__class__ is bytes and time_ns.__class__ is int and number in n_read:
                        n_read[number] += 1
                        if time_ns < 0:
                            time_ns &= _UNSIGNED
                        # NamedTuple's own constructor takes twice as long.
                        first, second = heads[number]
                        yield _MAKE(kind, (first, second, data, time_ns, time_ns))
                    else:
                        n_unknown += 1
            for number, count in n_read.items():
                self.counts[known[number].topic] += count
            n_found = self.counts.total() + n_unknown
            n_indexed = None if fault else _n_indexed(database)
            if n_indexed not in (None, n_found):
                what = f"its index of times lists {n_indexed} messages, {n_found} are readable"
                self.log.note(None, what)
        self.n_left_out = n_unknown
        if n_unknown:
            self.log.note(
                None, f"{n_unknown} messages have lost their topic, their time or their content"
            )

    def _rows(self, database: sqlite3.Connection, condition: str) -> Iterator[_Row]:
        data = "data"
        if self.path.stat().st_size > LARGEST_MESSAGE:
            data = f"CASE WHEN length(data) <= {LARGEST_MESSAGE} THEN data END"
        where = condition and f" WHERE{condition}"
        with _reading(self.path):
            return database.execute(f"SELECT topic_id, timestamp, {data} FROM messages{where}")

    def _salvaged(
        self, path: Path, wanted: list[int] | None, n_read: dict[int, int]
    ) -> Iterator[_Row]:
        """Rows of messages, each once, of a damaged file; those not wanted are counted."""
        pages = _pages(path)
        seen: set[int] = set()
        for number, row in pages.rows():
            match row:
                case (None, int(topic), int(time_ns), bytes(data)):
                    if number not in seen:
                        seen.add(number)
                        if wanted is None or topic in wanted or topic not in n_read:
                            yield topic, time_ns, data
                        else:
                            n_read[topic] += 1
        if pages.n_cut:
            self.log.note(None, f"{pages.n_cut} rows are cut off or damaged")
        for span in pages.lost():
            self.mark(*span)

    @contextmanager
    def _database(self) -> Iterator[tuple[Path, sqlite3.Connection]]:
        """The file and its database, of a part of a file those of a copy; `_opened` opens both."""
        if self.start == 0 and self.end is None:
            with _opened(self.path) as opened:
                yield opened
            return
        with tempfile.TemporaryDirectory() as folder, self.opened() as window:
            copy = Path(folder) / "part.db3"
            with copy.open("wb") as stream:
                for place in range(0, window.size, _BLOCK):
                    stream.write(window.read(place, min(_BLOCK, window.size - place)))
            with _opened(copy) as opened:
                yield opened


def _fault(database: sqlite3.Connection, *, whole: bool = True) -> str:
    """Why SQLite finds the file damaged, empty where it is sound; whole: read all of it."""
    result = "ok"
    try:
        for table in ("messages", "topics"):
            if not _is_plain(database, table):
                return f"the database has no plain table {table!r}"
        if whole:
            (result,) = database.execute("PRAGMA integrity_check(1)").fetchone()
        database.execute("SELECT id, topic_id, timestamp, data FROM messages LIMIT 1")
        database.execute("SELECT id, name, type FROM topics LIMIT 1")
    except sqlite3.Error as error:
        return f"the database cannot be read ({error})"
    verdict = " ".join(str(result).removeprefix("*** in database main ***").split())
    return "" if verdict == "ok" else f"the database is damaged ({verdict})"


def _is_plain(database: sqlite3.Connection, table: str) -> bool:
    """Whether it holds stored rows only: a view or computed column could give any number of any
    size."""
    query = "SELECT type, sql FROM sqlite_master WHERE name = ? COLLATE NOCASE"
    plain = all(
        kind == "table" and not str(text).upper().startswith("CREATE VIRTUAL")
        for kind, text in database.execute(query, (table,)).fetchall()
    )
    columns = database.execute(f"PRAGMA table_xinfo({table})").fetchall()
    return plain and all(hidden == 0 for *_, hidden in columns)


def _counts(
    database: sqlite3.Connection, known: dict[int, Channel], condition: str
) -> Counter[str]:
    """Messages of topics of which nothing else is read."""
    found: Counter[str] = Counter()
    query = f"SELECT topic_id, COUNT(*) FROM messages{condition} GROUP BY topic_id"
    with suppress(sqlite3.Error):
        for number, count in database.execute(query):
            if number in known:
                found[known[number].topic] += count
    return found


def _n_indexed(database: sqlite3.Connection) -> int | None:
    """Count the messages in the index that rosbag2 makes of their times, if there is one.

    SQLite reads the index without the table, in which a wrong page may hide rows.
    """
    query = "SELECT COUNT(timestamp) FROM messages INDEXED BY timestamp_idx"
    with suppress(sqlite3.Error):
        return int(database.execute(query).fetchone()[0])
    return None


def _channels(path: Path, database: sqlite3.Connection) -> dict[int, Channel]:
    """Channels by number; of a damaged file those whose rows are left.

    Older files have no type hashes and definitions, still older ones no quality of service.
    """
    try:
        columns = {row[1] for row in database.execute("PRAGMA table_info(topics)")}
        qos, digest = (
            name if name in columns else "''"
            for name in ("offered_qos_profiles", "type_description_hash")
        )
        texts: dict[str, tuple[str, str]] = {}
        if database.execute("PRAGMA table_info(message_definitions)").fetchall():
            query = "SELECT topic_type, encoding, encoded_message_definition"
            definitions = database.execute(f"{query} FROM message_definitions")
            texts = {name: (encoding, text) for name, encoding, text in definitions}
        found = {}
        query = f"SELECT id, name, type, serialization_format, {qos}, {digest} FROM topics"
        for number, name, type_name, encoding, profiles, type_hash in database.execute(query):
            if isinstance(name, str) and isinstance(type_name, str):
                written, text = texts.get(type_name, (ROS2MSG, ""))
                found[number] = _channel(
                    name, type_name, encoding, written, text, profiles, type_hash
                )
        if found or not _fault(database):
            return found
    except sqlite3.Error:
        pass
    rows = _pages(path).rows()
    return dict(each for number, row in rows for each in _topic_row(number, row))


def _channel(
    name: str, type_name: str, encoding: str, written: str, text: str, qos: object, digest: object
) -> Channel:
    metadata = ((QOS, str(qos)), (TYPE_HASH, str(digest)))
    return Channel(name, type_name, str(encoding), written, str(text).encode(), metadata)


def _topic_row(number: int, row: tuple[object, ...]) -> Iterator[tuple[int, Channel]]:
    match row:
        case (None, str(name), str(type_name), str(encoding), *rest) if name.startswith("/"):
            qos, type_hash = [*(str(each) for each in rest), "", ""][:2]
            yield number, _channel(name, type_name, encoding, ROS2MSG, "", qos, type_hash)


def _pages(path: Path) -> SqlitePages:
    with disk_errors("read", path, BagError), path.open("rb") as stream:
        size = path.stat().st_size
        content = mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) if size else b""
        return SqlitePages(content)


@contextmanager
def _reading(path: Path) -> Iterator[None]:
    """An error of SQLite within becomes a DamagedBagError."""
    try:
        yield
    except sqlite3.Error as error:
        raise DamagedBagError(
            f"{path} cannot be read any further ({error}); repair it with 'serd-bag rescue'"
        ) from None


@contextmanager
def _opened(path: Path) -> Iterator[tuple[Path, sqlite3.Connection]]:
    """The file and its database; where it was not closed, of a copy that includes what SQLite
    keeps beside it."""
    beside = [path.with_name(path.name + ending) for ending in _UNFINISHED]
    unfinished = [file for file in beside if file.is_file() and file.stat().st_size]
    with ExitStack() as stack:
        if unfinished:
            folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
            for file in (path, *unfinished):
                shutil.copy(file, folder)
            path = folder / path.name
            with suppress(sqlite3.Error), closing(sqlite3.connect(path)) as copy:
                copy.execute("PRAGMA wal_checkpoint(TRUNCATE)")
        with disk_errors("read", path, BagError):
            path.open("rb").close()
        uri = f"{path.resolve().as_uri()}?mode=ro&immutable=1"
        database = sqlite3.connect(uri, uri=True, check_same_thread=False)
        database.text_factory = lambda text: text.decode("utf-8", errors="replace")
        yield path, stack.enter_context(closing(database))
