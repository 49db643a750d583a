"""Organs: their surfaces, the distance to them, how they move, yield and look."""
