"""What decides: one Drake LeafSystem a block, grouped by the task it serves."""
