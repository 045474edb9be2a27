import numpy as np

from lab.experiments.gridworld.landscape import (
    cell_means,
    generated_landscape,
    landscape_of_image,
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
