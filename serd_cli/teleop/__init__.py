"""What `serd teleop` is made of: its settings, its terminal output, and its summary."""
