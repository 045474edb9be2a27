"""Commands of the world and of episodes in it, without ROS."""
