"""Settings of the experiments: one YAML file with defaults, unknown names refused."""

import pytest

from experiments.catalogue import EXPERIMENTS, experiment_of
from experiments.running.settings import (
    default_settings,
    file_settings,
    is_required,
    make_config,
    settings_of,
)
from serd_core.errors import SerdError


@pytest.mark.parametrize("experiment", EXPERIMENTS, ids=lambda each: each.name)
def test_the_file_holds_every_setting_with_the_default_of_its_config(experiment):
    required = {name: "." for name, (f, _) in settings_of(experiment).items() if is_required(f)}
    assert set(default_settings(experiment.name)) | set(required) == set(settings_of(experiment))
    assert make_config(experiment, required) == experiment.config(
        **{name: type_of(experiment, name)(value) for name, value in required.items()}
    )


def type_of(experiment, name):
    return settings_of(experiment)[name][1]


def test_a_file_changes_what_it_names_and_words_change_it_again(tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text("n_sets: 7\nsizes: [1, 2]\n")
    experiment = experiment_of("minimum-example")
    config = make_config(experiment, {**file_settings(experiment, path), "sizes": "3,5"})
    assert (config.n_sets, config.sizes) == (7, (3, 5))


def test_an_unknown_setting_gets_the_nearest_right_one(tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text("n_setts: 7\n")
    with pytest.raises(SerdError, match="n_setts is no setting of minimum-example; did you mean"):
        file_settings(experiment_of("minimum-example"), path)
