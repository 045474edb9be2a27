"""What density as a covariate of outcome models changes in the hallway."""
