"""Recorded episodes as pictures and movies."""
