"""Episodes in process: one, or many over many processes, and their measures."""
