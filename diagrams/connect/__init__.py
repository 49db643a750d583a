"""OpenIGTLink: a tracker's tools come in, what the robot does goes out."""
