"""One module per executable, some in packages; `serd_ros/process/executable.py` runs them."""
