"""The only sockets of the flight stack, and links in memory."""
