"""A node as a process: start, spin, end, and the command that started it."""
