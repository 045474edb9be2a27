"""The stages of the study, in order, with the settings each depends on."""

from collections.abc import Sequence
from pathlib import Path

from experiments.study.arrival.stage import arrival_tasks
from experiments.study.fits.fitting import fitting_tasks
from experiments.study.products import Stage
from experiments.study.recordings.demonstrations import demonstration_tasks
from experiments.study.recordings.experts import EXPERTS
from experiments.study.recordings.reference import reference_tasks
from experiments.study.settings import StudySettings
from storage.yaml_text import write_yaml

_WORLD = ("scenario", "people", "planner", "seed")
_REFERENCE = (*_WORLD, "demonstrations.driver", "reference")
_DEMONSTRATIONS = (*_REFERENCE, "discount", "demonstrations", "beliefs.reward_weights")
_FITS = (*_DEMONSTRATIONS, "learning", "beliefs.sizes", "beliefs.repetitions")
_ARRIVAL = (*_FITS, "beliefs.episodes", "arrival")
#: Rough seconds of one recorded episode, one fitted subset, one measured method.
_EPISODE_S, _SUBSET_S = 0.8, 1.0


def stages_of(settings: StudySettings, folder: Path) -> tuple[Stage, ...]:
    """All stages that tables and figures depend on."""
    reference, demonstrations = folder / "reference", folder / "demonstrations"
    fits, arrival = folder / "fits", folder / "arrival"
    sets = [
        task
        for expert in EXPERTS
        for task in demonstration_tasks(settings, expert, demonstrations, reference)
    ]
    return (
        Stage(
            "reference recordings",
            reference,
            described(settings, _REFERENCE),
            reference_tasks(settings, reference),
            task_s=15 * _EPISODE_S,
        ),
        Stage(
            "demonstrations",
            demonstrations,
            described(settings, _DEMONSTRATIONS),
            tuple(sets),
            task_s=_EPISODE_S * settings.demonstrations.training * 2 / 3,
        ),
        Stage(
            "learning",
            fits,
            described(settings, _FITS),
            fitting_tasks(settings, fits, folder),
            task_s=_SUBSET_S * len(settings.learning.sizes),
        ),
        Stage(
            "times of arrival",
            arrival,
            described(settings, _ARRIVAL),
            arrival_tasks(settings, arrival, fits),
            task_s=_EPISODE_S * 4 * settings.arrival.episodes / settings.learning.repetitions,
        ),
    )


def described(settings: StudySettings, names: Sequence[str]) -> str:
    """Some settings, by their dotted names, as YAML."""
    values = settings.model_dump(mode="json")
    return write_yaml({name: _at(values, name.split(".")) for name in names})


def _at(values: object, keys: Sequence[str]) -> object:
    for key in keys:
        assert isinstance(values, dict)
        values = values[key]
    return values
