"""One figure per module: pure functions from plain values to a matplotlib Figure."""
