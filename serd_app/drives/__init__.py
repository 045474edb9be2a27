"""From recordings and live topics to drives: poses, actions and episodes on one clock."""
