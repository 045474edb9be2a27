"""Times of arrival: predicted by absorbing chains, measured, with bands; trap states."""
