"""What a mobile robot sees: its place, a grid of what stands, and who walks."""
