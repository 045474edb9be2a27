"""The fault campaign: episodes in which an input of the robot fails, with and without the guard."""
