"""Checks of a recording: damage, losses, rates, gaps and clocks."""
