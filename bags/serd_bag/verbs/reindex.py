"""`reindex`: summaries of MCAP files and metadata.yaml anew, in place."""

from collections import Counter
from pathlib import Path
from tempfile import TemporaryDirectory

from serd_bag.errors import BagError
from serd_bag.files import atomic_write_text
from serd_bag.formats.limits import yaml_text
from serd_bag.formats.mcap.file_end import FileEnd
from serd_bag.formats.rosbag2.layout import (
    FILE_NAME,
    ROOT_KEY,
    FileSpan,
    bag_metadata,
    storage_kind,
)
from serd_bag.reader import BagReader
from serd_bag.rescue.saving import kept_metadata, rescue
from serd_bag.topic import Channel


def reindex(path: str | Path) -> int:
    """Write what leads to the messages of a bag anew, from the messages; returns their number.

    An MCAP file without a right summary is replaced by one with the same records, and metadata.yaml
    of a bag folder is written. Raises BagError, and changes nothing of a file, where messages of it
    are lost: `rescue` saves the others.
    """
    path = Path(path)
    reader = BagReader(path, tolerant=True)
    for file in reader.layout.files:
        if storage_kind(file) == ".mcap" and not FileEnd(file).states_contents:
            _replace(file)
        elif storage_kind(file) == ".bag":
            raise BagError(f"{file} must be of ROS 2; save it with 'serd-bag rescue'")
    if not path.is_dir():
        return sum(1 for _ in BagReader(path).records())
    reader = BagReader(path, tolerant=True)
    spans, counts = [], Counter[Channel]()
    for scan, records in reader.walks():
        n_messages, times = 0, list[int]()
        for record in records:
            counts[record.channel] += 1
            n_messages += 1
            times = [min([record.log_time_ns, *times]), max([record.log_time_ns, *times])]
        spans.append(FileSpan(scan.path.name, n_messages, *times))
    channels = [(channel, counts[channel]) for channel in reader.channels]
    values = bag_metadata(spans, channels, kept_metadata(reader))
    values["storage_identifier"] = (
        "mcap" if storage_kind(reader.layout.files[0]) == ".mcap" else "sqlite3"
    )
    atomic_write_text(path / FILE_NAME, yaml_text({ROOT_KEY: values}))
    return counts.total()


def _replace(file: Path) -> None:
    """Put a file with a summary in the place of one without."""
    with TemporaryDirectory(dir=file.parent, prefix=".") as folder:
        found = rescue(file, Path(folder) / file.stem)
        if found.least_lost or found.n_doubtful or found.n_left_out:
            raise BagError(
                f"{file} must have all its messages, it has lost {found.least_lost} or more; save"
                " the others with 'serd-bag rescue'"
            )
        (Path(folder) / file.stem / f"{file.stem}_0.mcap").replace(file)
