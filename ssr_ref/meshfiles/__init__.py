"""Mesh files to scenes: one reader a format, and what they share."""
