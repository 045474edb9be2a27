"""What a planner can know of people from the lidar alone."""
