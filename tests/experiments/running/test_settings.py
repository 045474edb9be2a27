"""Settings of the experiments: fields of their configs, unknown names refused."""

import pytest

from experiments.catalogue import EXPERIMENTS, experiment_of
from experiments.running.settings import (
    file_settings,
    is_required,
    make_config,
    settings_of,
)
from serd_core.errors import SerdError


@pytest.mark.parametrize("experiment", EXPERIMENTS, ids=lambda each: each.name)
def test_a_config_without_given_settings_has_the_defaults_of_its_class(experiment):
    required = {name: "." for name, (f, _) in settings_of(experiment).items() if is_required(f)}
    assert all("about" in field.metadata for field, _ in settings_of(experiment).values())
    assert make_config(experiment, required) == experiment.config(
        **{name: type_of(experiment, name)(value) for name, value in required.items()}
    )


def type_of(experiment, name):
    return settings_of(experiment)[name][1]


def test_a_file_changes_what_it_names_and_options_change_it_again(tmp_path):
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
