"""What several test folders share: messages, bags and observations."""
