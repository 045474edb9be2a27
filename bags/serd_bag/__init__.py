"""Reading, writing, checking and repairing rosbag2 recordings. No ROS is needed."""
