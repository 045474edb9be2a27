"""The hallway: scenario, people, robot, lidar, local planner and episodes. No ROS."""
