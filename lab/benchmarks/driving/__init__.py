"""Driving among people: arrivals, contacts, and what a step costs."""
