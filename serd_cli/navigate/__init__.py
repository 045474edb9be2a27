"""`serd navigate`: a learned model drives, and its predicted arrivals are held against it."""
