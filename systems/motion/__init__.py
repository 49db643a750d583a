"""From a wanted velocity to joints, and the camera."""
