"""Suites: frozen scenarios for comparisons."""

import hashlib
from pathlib import Path

import pytest

from serd_files.errors import USER_ERRORS
from serd_sim.scenario import scenario as scenario_module
from serd_sim.scenario.scenario import load_scenario, scenario_suite, suite_names

#: A suite never changes: another scenario, or an edited one, is another suite.
FROZEN = {"social_v1": "8e61eb9b74d83828"}


def test_suites_hold_scenarios_that_load_by_their_names():
    for suite in suite_names():
        assert len(scenario_suite(suite)) >= 12
        for name in scenario_suite(suite):
            assert name == f"{suite}/{load_scenario(name).name}"
    assert scenario_suite("hallway") == ()


@pytest.mark.parametrize("suite", suite_names())
def test_a_suite_is_frozen(suite):
    folder = Path(scenario_module.__file__).parent / "scenarios"
    content = b"".join((folder / f"{name}.yaml").read_bytes() for name in scenario_suite(suite))
    assert hashlib.sha256(content).hexdigest()[:16] == FROZEN[suite]


def test_a_mistyped_name_in_a_suite_gets_the_nearest():
    with pytest.raises(USER_ERRORS, match="did you mean 'social_v1/narrow_doorway'"):
        load_scenario("social_v1/narow_doorway")
