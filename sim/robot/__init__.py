"""The robot as it really is: motion, physics world, lidar, odometry, contacts."""
