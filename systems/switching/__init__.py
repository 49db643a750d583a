"""Switching potentials (after Fedele et al.): one potential at a time."""
