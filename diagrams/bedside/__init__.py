"""The arm at the bedside: its plant, and the passive wrist in every diagram."""
