"""Publishers and subscriptions: topics, types, quality of service."""
