"""rosbag2/MCAP in and out, crash-safe recording, and bags as demonstrations. No ROS is needed."""
