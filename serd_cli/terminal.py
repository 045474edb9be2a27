"""Where things are printed: results to stdout, progress and errors to stderr."""

from rich.console import Console

console = Console(highlight=False)
progress_console = Console(stderr=True, highlight=False)
