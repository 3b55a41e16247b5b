"""Rasterizing: clip, coverage, visibility, interpolation."""
