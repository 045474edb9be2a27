"""Recordings of many kinds, from the file to the held-out likelihood."""
