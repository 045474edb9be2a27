"""From demonstrations to a model file: the learning recipe, its task, checkpoint and files."""
