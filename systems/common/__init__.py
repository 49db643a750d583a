"""What every block shares: its base class, geometry, fuzzy inference."""
