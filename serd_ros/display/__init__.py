"""What the strategy publishes for viewers."""
