"""Tissue: masks, voxels, free space, and what the tool carves."""
