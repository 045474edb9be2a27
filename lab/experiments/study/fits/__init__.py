"""The learners of the hallway study and their fits."""
