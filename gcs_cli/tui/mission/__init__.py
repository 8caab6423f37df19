"""The screen Mission: items, edits, upload and progress."""
