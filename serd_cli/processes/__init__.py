"""Processes that commands start: ROS nodes, alone or as stacks, with their environment."""
