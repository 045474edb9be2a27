"""Commands that start nodes, and the check of what these need."""
