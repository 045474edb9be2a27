"""Four robots on the same seeds: what learned rewards and dynamics are worth in two tasks."""
