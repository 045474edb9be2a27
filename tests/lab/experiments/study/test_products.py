from functools import partial

import pytest

from lab.experiments.study.products import Stage, Task, load_recorded, make_products, save_recorded
from serd_core.demonstrations.decisions import decisions_from_episodes
from serd_files.errors import USER_ERRORS
from serd_sim.episodes.execution import Execution

ALONE = Execution(n_jobs=1)


def write(text, file):
    file.write_text(text)


def interrupt(file):
    raise KeyboardInterrupt(file.name)


def stage(folder, *tasks, description="these settings"):
    made = tuple(Task(folder / f"{number}.txt", make) for number, make in enumerate(tasks))
    return Stage("writing", folder, description, made, task_s=2.0)


def quiet(done_s, total_s, name):
    pass


def test_what_is_there_is_not_made_again(tmp_path):
    make_products([stage(tmp_path, partial(write, "first"))], ALONE, quiet)
    make_products([stage(tmp_path, partial(write, "again"), partial(write, "new"))], ALONE, quiet)
    assert (tmp_path / "0.txt").read_text() == "first"
    assert (tmp_path / "1.txt").read_text() == "new"


def test_interrupted_it_goes_on_where_it_stopped(tmp_path):
    with pytest.raises(KeyboardInterrupt):
        make_products([stage(tmp_path, partial(write, "done"), interrupt)], ALONE, quiet)
    again = stage(tmp_path, interrupt, partial(write, "rest"))
    make_products([again], ALONE, quiet)
    assert not again.missing


RECORDED = decisions_from_episodes([([0, 1], [2])])
TO_BE_MADE_ANEW = r"training.csv must hold what .* delete it and run the"


@pytest.mark.parametrize("changed", ["", "episode,time_s\n", ",x,", ",3,"])
def test_a_damaged_recording_is_to_be_made_anew(tmp_path, changed):
    file = tmp_path / "people_00_training.csv"
    save_recorded(file, RECORDED)
    assert len(load_recorded(file)) == 1
    is_cell = changed.startswith(",")
    file.write_text(file.read_text().replace(",1,", changed) if is_cell else changed)
    with pytest.raises(USER_ERRORS, match=TO_BE_MADE_ANEW):
        load_recorded(file)
    save_recorded(file, RECORDED)
    assert len(load_recorded(file)) == 1


def test_a_damaged_digest_is_that_of_its_table_and_an_earlier_version_wrote_none(tmp_path):
    file = tmp_path / "people_00_training.csv"
    save_recorded(file, RECORDED)
    file.with_suffix(".json").write_text("{}")
    with pytest.raises(USER_ERRORS, match=TO_BE_MADE_ANEW):
        load_recorded(file)
    file.with_suffix(".json").unlink()
    assert len(load_recorded(file)) == 1


def test_products_of_other_settings_are_refused(tmp_path):
    make_products([stage(tmp_path, partial(write, "mine"))], ALONE, quiet)
    other = stage(tmp_path, partial(write, "theirs"), description="other settings")
    with pytest.raises(USER_ERRORS, match="holds results of another configuration"):
        make_products([other], ALONE, quiet)


def test_progress_tells_the_work_that_is_left(tmp_path):
    calls = []
    stages = [
        stage(tmp_path / "a", partial(write, "x"), partial(write, "y")),
        stage(tmp_path / "b", partial(write, "z")),
    ]
    make_products(stages, ALONE, lambda *progress: calls.append(progress[:2]))
    assert calls == [(0, 6), (2, 6), (4, 6), (4, 6), (6, 6)]
