"""How well models predict: forecasts beside measurements, and how usual trajectories are."""
