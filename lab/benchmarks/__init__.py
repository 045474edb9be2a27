"""Speed: `python -m lab benchmarks` writes lab/results/*.json."""
