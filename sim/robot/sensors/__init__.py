"""What the robot measures: laser scans, inertial measurements and odometry."""
