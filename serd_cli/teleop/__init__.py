"""What `serd teleop` is made of: its settings and its terminal output."""
