"""A mapping for a bag of another robot, found by its topics and tested against the motion."""
