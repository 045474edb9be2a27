"""What the product does without ROS: drives, demonstrations, learning and navigation."""
