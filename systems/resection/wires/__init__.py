"""Carrying a plan out: postures, wires, drums, tensions."""
