"""A file per method: TITLE, REQUIREMENTS of an environment of its own, and `learn`."""
