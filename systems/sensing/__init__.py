"""What the robot knows: tracker, estimators, the wrist's sensor, its own tool."""
