"""File formats of bags: MCAP and SQLite as of rosbag2, and those of ROS 1."""
