"""Places of scenarios: maps of ROS and grids of recordings as walls, cells and areas."""
