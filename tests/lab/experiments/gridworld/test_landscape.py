from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from lab.experiments.gridworld.landscape import (
    cell_means,
    generated_landscape,
    image_brightness,
    landscape_of_image,
)

AERIAL = Path(__file__).parents[5] / "shared" / "data" / "aerial"
PHOTOGRAPH = AERIAL / "2019_YELL_2_541000_4977000_image_crop.png"
needs_aerial = pytest.mark.skipif(
    not AERIAL.is_dir(), reason=f"the aerial images are not there; put them in {AERIAL}"
)


def test_cells_are_means_of_their_pixels():
    image = np.arange(24.0).reshape(4, 6)
    np.testing.assert_allclose(cell_means(image, 2), [[4.0, 7.0], [16.0, 19.0]])


def test_rough_cells_are_forest_and_rows_count_northwards():
    image = np.full((80, 80), 0.5)
    image[:40] += 0.2 * np.random.default_rng(0).choice([-1, 1], size=(40, 80))
    image[60:, :40] = 0.9
    landscape = landscape_of_image(image, 4)
    np.testing.assert_array_equal(landscape.forest[2:], True)
    np.testing.assert_array_equal(landscape.forest[:2], False)
    assert landscape.brightness[0, 0] == 1.0
    assert landscape.brightness.min() == 0.0


def test_generated_landscapes_have_both_terrains_and_a_bright_road():
    landscape = generated_landscape(20, np.random.default_rng(1))
    assert 0.2 < landscape.forest.mean() < 0.6
    assert np.all((landscape.brightness == 1.0).any(axis=0))
    again = generated_landscape(20, np.random.default_rng(1))
    np.testing.assert_array_equal(landscape.brightness, again.brightness)


@needs_aerial
def test_the_rule_agrees_with_hand_drawn_trees_in_most_cells():
    """Independent truth: a cell with trees has hand-drawn tree boxes on a quarter of it."""
    image = image_brightness(PHOTOGRAPH)
    trees = np.zeros_like(image)
    for box in ElementTree.parse(PHOTOGRAPH.with_suffix(".xml")).iter("bndbox"):
        x_min, y_min, x_max, y_max = (
            int(float(box.findtext(name))) for name in ("xmin", "ymin", "xmax", "ymax")
        )
        trees[y_min:y_max, x_min:x_max] = 1.0
    truth = cell_means(trees, 20) > 0.25
    forest = landscape_of_image(image, 20).forest[::-1]
    assert (forest == truth).mean() > 0.7
