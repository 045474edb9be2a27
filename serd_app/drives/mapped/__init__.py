"""Drives from bags of other robots, by a mapping file."""
