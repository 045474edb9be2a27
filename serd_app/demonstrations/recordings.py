"""Recordings of one place, each read by the mapping that fits it, with the people in them."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from serd_app.demonstrations.suggestion.suggest import mapping_of_poses
from serd_app.drives.mapped.mapping import BagMapping, DriveMapping
from serd_app.drives.recorded_drive import RecordedDrive
from serd_app.drives.recorded_people import Sighting, sightings_of_all
from serd_app.drives.recording import Recording, read_recording
from serd_app.drives.table_drives import is_table
from serd_sim.scenario.scenario import Scenario


@dataclass(frozen=True, eq=False)
class Recordings:
    """all: one of each bag or table; mappings: None for a table or a bag of our recorder."""

    all: tuple[Recording, ...]
    mappings: tuple[DriveMapping | None, ...]
    tolerant: bool

    @property
    def drives(self) -> list[RecordedDrive]:
        """Those of all recordings."""
        return [drive for each in self.all for drive in each.drives]

    @property
    def people(self) -> BagMapping:
        """The mapping that names topic and frame of people: the first of a bag."""
        of_bags = (each for each in self.mappings if isinstance(each, BagMapping))
        return next(of_bags, BagMapping())

    def sightings(self) -> list[list[Sighting]]:
        """People in each recording."""
        paths, people = [each.bag for each in self.all], self.people
        topic, frame = people.people_topic, people.frame
        return sightings_of_all(paths, topic, frame=frame, tolerant=self.tolerant)


def read_recordings(
    paths: Sequence[Path],
    *,
    mapping: DriveMapping | None,
    scenario: Scenario | None,
    tolerant: bool = False,
    hidden: bool = False,
) -> Recordings:
    """Bags or tables; a bag of poses alone needs no mapping. Options: as of `read_recording`."""
    mappings = tuple(
        mapping or (None if is_table(each) else mapping_of_poses(each)) for each in paths
    )
    recordings = tuple(
        read_recording(
            each,
            mapping=chosen,
            tolerant=tolerant,
            hidden=hidden,
            goal_area_m=scenario.goal_area_m if scenario else (),
        )
        for each, chosen in zip(paths, mappings, strict=True)
    )
    return Recordings(recordings, mappings, tolerant)
