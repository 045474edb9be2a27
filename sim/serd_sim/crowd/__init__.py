"""People who walk under social forces, and their comparison with measured crowds."""
