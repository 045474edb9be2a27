"""What the robot measures: laser scans and odometry."""
