"""The rclpy nodes: thin shells that convert messages, call one core object and publish."""
