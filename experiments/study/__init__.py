"""The hallway study (chapter 5): data, fits, predictions, measurements, tables and figures.

Each stage leaves files; what is there already is not made again.
"""
