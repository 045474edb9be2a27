"""Tables of the hallway study."""
