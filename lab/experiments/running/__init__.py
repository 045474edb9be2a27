"""Running an experiment: settings, repetitions, provenance of results, summaries."""
