"""What rosbag2 keeps around the messages: files, metadata, topics, types, quality of service."""
