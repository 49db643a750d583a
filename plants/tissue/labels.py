"""What a voxel is, of a `Tissue` (brain, tumour, critical) and a `Volume` (all)."""

BRAIN, TUMOUR, CHANNEL, CAP, CRITICAL = range(5)
NAMES = ("brain", "tumour", "channel", "cap", "critical")
