"""Passive wrist emulation: the fulcrum found by force."""
