"""The world, and the observations, commands and waypoints at its interface."""
