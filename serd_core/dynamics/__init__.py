"""Transition models P(s' | s, a) and their parameters."""
