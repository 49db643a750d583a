"""Attract or bypass, and a hard clearance (after both papers)."""
