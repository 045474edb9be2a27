"""The parts of rosbag2 around the messages: files, metadata, types, quality of service."""
