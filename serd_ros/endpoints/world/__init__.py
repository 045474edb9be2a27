"""The simulated world as nodes meet it: its clock, its robots, and other worlds."""
