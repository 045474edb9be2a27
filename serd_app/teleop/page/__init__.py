"""The web page for driving by hand: its data, its requests, access, and the server."""
