"""Driving by hand: who may command the robot, keys, joystick, episodes, and the web page."""
