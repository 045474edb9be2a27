"""Figures of the hallway study, drawn from its tables."""
