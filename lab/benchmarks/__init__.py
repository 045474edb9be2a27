"""Speed against peers, in one run: `python -m lab benchmarks` writes lab/results/*.json."""
