"""Grid and flow of recordings: fitted, read and written, and how fine they may be."""
