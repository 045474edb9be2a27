"""Gridworld navigation on satellite images (section 4.6.2)."""
