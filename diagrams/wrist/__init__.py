"""The passive wrist alone: a scripted task, the wrist, the arm, the wall."""
