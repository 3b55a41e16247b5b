"""Oracles: slow, obvious, exact, and independent of the package that they judge."""
