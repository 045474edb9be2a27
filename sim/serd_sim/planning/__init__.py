"""Local planners: rollouts, what they cost, two ways to choose among them, and recovery."""
