"""The page in light and dark, on a desk and on a phone, by axe-core and by its size."""

import pytest

from support.browser import (
    DEVICES,
    SCHEMES,
    needs_chromium,
    sideways_px,
    start_chromium,
    view,
    violations,
)

pytestmark = [pytest.mark.slow, needs_chromium]


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    browser = start_chromium(tmp_path_factory.mktemp("browser"))
    yield browser
    browser.quit()


@pytest.mark.parametrize(
    ("scheme", "width", "height"), [(SCHEMES[0], *DEVICES[0]), (SCHEMES[1], *DEVICES[1])]
)
def test_axe_finds_no_violation_and_nothing_is_wider_than_the_window(
    browser, page, scheme, width, height
):
    view(browser, width=width, height=height, scheme=scheme)
    browser.get(page.as_uri())
    assert violations(browser) == []
    assert sideways_px(browser) == 0


def colours_of(browser, css):
    """Red, green and blue of the background of an element."""
    found = browser.execute_script(
        "return getComputedStyle(document.querySelector(arguments[0])).backgroundColor", css
    )
    return [int(each) for each in found.removeprefix("rgb(").removesuffix(")").split(",")[:3]]


def test_figures_have_no_white_boxes_in_the_dark(browser, page):
    """The white of a figure becomes the shade of the box around it, to two of 255."""
    view(browser, width=1280, height=900, scheme="dark")
    browser.get(page.as_uri())
    box = colours_of(browser, "figure")
    assert max(box) < 40
    shade = browser.execute_script(
        "return getComputedStyle(document.querySelector('figure img')).filter"
    )
    assert shade == "invert(0.88) hue-rotate(180deg)"
    assert max(abs(each - 255 * (1 - 0.88)) for each in box) <= 2
