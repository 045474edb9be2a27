"""Files: strict YAML, typed tables, atomic writes, models and pictures of grids."""
