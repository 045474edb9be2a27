"""Whether headlines are true: recordings of a stand-in robot, and drives by what was learned."""
