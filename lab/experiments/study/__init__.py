"""The hallway study (chapter 5): data, fits, predictions, measurements, tables and figures.

Each stage writes files; stages whose files exist are not run again.
"""
