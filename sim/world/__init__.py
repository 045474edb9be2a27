"""The world and what passes between it and whoever drives: observations, commands, waypoints."""
