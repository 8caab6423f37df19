"""Sockets and serial lines, and links in memory."""
