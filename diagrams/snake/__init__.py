"""The wire-driven snake in motion."""
