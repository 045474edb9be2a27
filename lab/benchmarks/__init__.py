"""Speed against peers, in one run: `python -m lab bench` writes lab/results/*.json."""
