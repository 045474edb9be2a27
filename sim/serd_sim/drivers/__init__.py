"""Drivers decide at each decision epoch: the scripted expert and learned policies."""
