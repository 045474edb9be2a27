"""The sqlite3 storage of rosbag2, whole or damaged."""
