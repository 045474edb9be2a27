"""People who walk under social forces, and how they are held against measured crowds."""
