"""Supervision of commands: a collision monitor, and the age and plausibility of each input."""
