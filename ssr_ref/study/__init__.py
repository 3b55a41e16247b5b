"""Measuring the kernels: exact oracles and test vectors."""
