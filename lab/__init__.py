"""What the authors run: experiments and studies of the thesis, benchmarks, and their results."""

from pathlib import Path

#: What runs write unless another folder is named: below the root, where `python -m lab` runs.
RESULTS = Path("lab/results")
