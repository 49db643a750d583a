"""Gauze delivery: the auto-guided movements end to end."""
