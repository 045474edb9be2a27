"""The node graph as data, and whether all its endpoints are connected."""
