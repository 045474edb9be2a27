"""What the hallway study records: experts, demonstrations, reference dynamics."""
