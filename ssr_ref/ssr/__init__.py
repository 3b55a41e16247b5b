"""Screen-space tracers: rays, hit rule, walks, fades, composite."""
