"""The folder of a drive, which belongs to the settings and the files that it was begun with."""

import hashlib
from pathlib import Path

from serd_app.errors import AppError
from serd_app.navigation.drive import DriveSettings
from sim.scenario.scenario import scenario_digest
from storage.files import atomic_write_text, read_text
from storage.yaml_config import load_yaml_model, model_yaml

_FILE = "navigate.yaml"


class BegunDrive(DriveSettings):
    """The settings of the drive, and digests of the content of its two files.

    Folders of older versions have empty digests.
    """

    model_digest: str = ""
    scenario_digest: str = ""


def claim_folder(folder: Path, settings: DriveSettings) -> None:
    """Take a new folder, or one that was begun with the same settings; AppError otherwise."""
    file = folder / _FILE
    now = BegunDrive(
        **settings.model_dump(),
        model_digest=hashlib.sha256(read_text(settings.model).encode()).hexdigest()[:12],
        scenario_digest=scenario_digest(settings.place()),
    )
    if file.is_file():
        _require_same(folder, load_yaml_model(file, BegunDrive), now)
        return
    if folder.exists() and any(folder.iterdir()):
        raise AppError(f"{folder} must be new, empty or an earlier run's; give another folder")
    atomic_write_text(file, model_yaml(now))


def _require_same(folder: Path, earlier: BegunDrive, now: BegunDrive) -> None:
    for name in DriveSettings.model_fields:
        if name != "episodes" and getattr(earlier, name) != getattr(now, name):
            raise AppError(
                f"{folder} was begun with {name} = {getattr(earlier, name)!r}, but "
                f"{getattr(now, name)!r} is given; give another folder or the same settings"
            )
    for name, recorded, found in (
        (now.model, earlier.model_digest, now.model_digest),
        (now.scenario, earlier.scenario_digest, now.scenario_digest),
    ):
        if recorded != found:
            raise AppError(
                f"{folder} must hold drives of {name} as it is now ({found}), but was begun with "
                f"{recorded or 'an unknown version'} of it; give another folder"
            )
