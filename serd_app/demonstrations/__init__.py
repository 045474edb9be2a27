"""From drives to demonstrations: decisions (s, a, s') on a grid, and the files that keep them."""
