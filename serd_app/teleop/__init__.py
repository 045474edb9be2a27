"""Driving by hand: command mux, keyboard, joystick, episodes, and the web page."""
