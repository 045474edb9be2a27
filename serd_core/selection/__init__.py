"""Choosing among fits: starts, stopping times and prior weights."""
