"""Tables of trajectories as other programs write them: time, agent, x and y under any names."""
