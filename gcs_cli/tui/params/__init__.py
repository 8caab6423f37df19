"""The screen Parameters: search, edit, compare and save."""
