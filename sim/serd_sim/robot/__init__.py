"""The simulated robot: motion, physics world, lidar, odometry, contacts."""
