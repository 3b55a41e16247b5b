"""Scalar kernels: vectors, exact products, elementary functions, noise."""
