"""What obeys: arm, abdomen, instruments, snake and mobile robot."""
