"""What walks about: obstacles that move, and crowds."""
