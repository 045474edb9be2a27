"""Values out of serialized standard messages."""
