"""Recordings: how fast, how whole, and of how many kinds they are read."""
