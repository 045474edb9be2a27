import pytest

from lab.experiments.study.recordings.drives import Purpose, world_seed
from lab.experiments.study.recordings.experts import EXPERTS
from lab.experiments.study.settings import study_settings
from serd_bag.errors import FileError


def test_quick_changes_numbers_and_keeps_the_rest():
    full, quick = study_settings(), study_settings(quick=True)
    assert quick.arrival.episodes < full.arrival.episodes
    assert quick.beliefs.reward_weights == full.beliefs.reward_weights
    assert quick.seed == full.seed


def test_a_file_may_change_any_part(tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text("people: 7\nlearning: {repetitions: 3}\n")
    changed = study_settings(config=file)
    assert (changed.people, changed.learning.repetitions) == (7, 3)
    assert changed.learning.sizes == study_settings().learning.sizes


@pytest.mark.parametrize("sizes", ["[1, 4]", "[4, 2]", "[2, 21]"])
def test_sizes_must_grow_within_what_is_recorded(tmp_path, sizes):
    file = tmp_path / "mine.yaml"
    file.write_text(f"learning: {{sizes: {sizes}}}\n")
    with pytest.raises(FileError, match="sizes must grow from at least 2 to at most"):
        study_settings(config=file)


def test_every_recording_has_a_seed_of_its_own():
    seeds = [
        world_seed(5000, expert, repetition, purpose)
        for expert in EXPERTS
        for repetition in range(100)
        for purpose in Purpose
    ]
    assert len(set(seeds)) == len(seeds)
