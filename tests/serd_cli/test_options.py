"""Options made from settings: every setting of a model is one, with its default and range."""

import pytest
import typer
from typer.testing import CliRunner

from serd_app.learning.settings import LearningSettings
from serd_cli.errors import UsageError
from serd_cli.options import validated, with_settings


def app_with(given):
    app = typer.Typer()

    @app.command()
    @with_settings(LearningSettings, prior_weights="--prior-weight")
    def command(output: str = "here", seed: int = 7, **options):
        given.update(options, output=output, seed=seed)

    return app


def test_every_setting_is_an_option_with_its_default():
    given = {}
    assert CliRunner().invoke(app_with(given), []).exit_code == 0
    assert given.pop("output") == "here"
    assert given.pop("seed") == 7
    assert given.keys() == LearningSettings.model_fields.keys() - {"seed"}
    assert validated(LearningSettings, **given) == LearningSettings()


def test_options_of_lists_are_repeated_and_have_the_given_flag():
    given = {}
    line = ["--prior-weight", "2", "--prior-weight", "3", "--reirl-smoothing", "0.5"]
    assert CliRunner().invoke(app_with(given), line).exit_code == 0
    assert given["prior_weights"] == [2.0, 3.0]
    assert given["reirl_smoothing"] == [0.5]


def test_a_value_beyond_an_inclusive_limit_is_refused_by_the_option():
    ended = CliRunner().invoke(app_with({}), ["--minimum-decisions", "0"])
    assert ended.exit_code == 2
    assert "'--minimum-decisions'" in ended.output


def test_a_value_at_an_exclusive_limit_is_refused_by_the_model():
    with pytest.raises(UsageError, match="discount must be less than 1, got 1"):
        validated(LearningSettings, discount=1.0)
