"""Times of arrival in the hallway study: predicted, measured, compared."""
