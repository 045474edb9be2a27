"""The MCAP container: what is written, what is read, and what is left of a damaged file."""
