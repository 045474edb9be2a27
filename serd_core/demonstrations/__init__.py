"""Demonstrations as tables and trajectories, and sampling them."""
