"""What `serd doctor` checks."""
