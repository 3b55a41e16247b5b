"""Diffuse radiance of visible surfaces."""
