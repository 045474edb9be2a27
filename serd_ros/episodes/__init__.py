"""Nodes that drive episodes: resets, marks, results."""
