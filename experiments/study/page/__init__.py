"""The page of the hallway study: Markdown tables made from CSV files."""
