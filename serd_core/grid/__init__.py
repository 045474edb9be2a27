"""The coarse grid, its directions, and the navigation problem on it."""
