"""Depth as devices store it, and linear view depth."""
