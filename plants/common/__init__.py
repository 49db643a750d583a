"""What every plant shares."""
