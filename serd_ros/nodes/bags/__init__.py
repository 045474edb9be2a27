"""Nodes that write topics to recordings, and publish recordings."""
