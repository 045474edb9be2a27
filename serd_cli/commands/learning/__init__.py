"""Commands from recordings to models and what these predict."""
