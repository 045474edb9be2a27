"""Saving what a broken recording still holds, and the certificate of what was lost."""
