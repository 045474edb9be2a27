"""Route choice on networks: recursive logit with many destinations, undiscounted."""
