"""Nodes by which a person drives: inputs by keys, joystick and web page, and their mux."""
