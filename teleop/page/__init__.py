"""The web page for driving by hand: what it shows, what it may ask, and its server."""
