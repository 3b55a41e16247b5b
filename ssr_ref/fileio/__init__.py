"""Meshes, images and bundles on disk."""
