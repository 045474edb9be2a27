"""Of the thesis, what the library does not need: ascent, starts, stops, gradients, priors."""
