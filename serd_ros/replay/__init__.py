"""A bag on its topics again."""
