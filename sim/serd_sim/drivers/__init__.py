"""Drivers decide once per decision period: the scripted expert and learned policies."""
