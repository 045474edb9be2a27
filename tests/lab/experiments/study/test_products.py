from functools import partial

import pytest

from lab.experiments.study.products import Stage, Task, make_products
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


def test_interrupted_it_goes_on_where_it_stopped(tmp_path):
    with pytest.raises(KeyboardInterrupt):
        make_products([stage(tmp_path, partial(write, "done"), interrupt)], ALONE, quiet)
    again = stage(tmp_path, interrupt, partial(write, "rest"))
    make_products([again], ALONE, quiet)
    assert not again.missing


def test_products_of_other_settings_are_refused(tmp_path):
    make_products([stage(tmp_path, partial(write, "mine"))], ALONE, quiet)
    other = stage(tmp_path, partial(write, "theirs"), description="other settings")
    with pytest.raises(USER_ERRORS, match="holds results of another configuration"):
        make_products([other], ALONE, quiet)
