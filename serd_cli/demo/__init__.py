"""The whole loop as one command: demonstrate, record, learn, navigate, report."""
