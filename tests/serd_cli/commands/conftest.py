import pytest


@pytest.fixture
def whole_pictures() -> None:
    """For tests whose pictures are as users get them."""


@pytest.fixture(autouse=True)
def _pictures(request: pytest.FixtureRequest) -> None:
    """Each of these commands draws several."""
    if "whole_pictures" not in request.fixturenames:
        request.getfixturevalue("quick_pictures")
