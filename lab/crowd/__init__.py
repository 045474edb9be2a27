"""The crowd beside measured ones: Weidmann's speeds and recordings of corridors."""
