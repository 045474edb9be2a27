"""What demonstrations reveal: of a move that is avoided, and the next demonstration to ask for."""
