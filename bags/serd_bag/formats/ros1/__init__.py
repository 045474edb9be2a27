"""Bags of ROS 1, format 2.0."""
