"""Laparoscopic instruments, the surgeon's tools and the endoscope."""
