"""The stages, tables and figures of the hallway study."""
