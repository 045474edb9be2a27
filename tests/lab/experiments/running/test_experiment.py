"""Settings of the experiments: fields of their models, unknown names rejected."""

import pytest

from lab.catalogue import EXPERIMENTS, experiment_named
from lab.experiments.running.experiment import settings_of_file
from serd_files.errors import USER_ERRORS
from serd_files.settings import settings_of

MINIMUM = experiment_named("minimum-example")


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_a_config_without_given_settings_has_the_defaults_of_its_class(name):
    experiment = experiment_named(name)
    required = {"data": "."} if name in ("rust", "routes") else {}
    assert all(each.description for each in settings_of(experiment.config))
    assert experiment.make_config(required) == experiment.config(**required)


def test_a_file_changes_what_it_names_and_options_change_it_again(tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text("n_sets: 7\nsizes: [1, 2]\n")
    config = MINIMUM.make_config({**settings_of_file(path), "sizes": "3,5"})
    assert (config.n_sets, config.sizes) == (7, (3, 5))


def test_an_unknown_setting_gets_the_nearest_right_one():
    with pytest.raises(USER_ERRORS, match="n_setts is not a known key; did you mean 'n_sets'"):
        MINIMUM.make_config({"n_setts": 7})


def test_a_file_without_names_is_rejected(tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text("- 7\n")
    with pytest.raises(USER_ERRORS, match="must hold settings as 'name: value', got \\[7\\]"):
        settings_of_file(path)
