"""What fails in the world: sensors, frames, a slow arm."""
