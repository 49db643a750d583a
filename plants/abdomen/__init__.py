"""The abdominal wall with its trocar spring."""
