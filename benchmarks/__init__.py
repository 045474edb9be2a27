"""Speed against peers, in one run: `make bench` writes results/*.json."""
