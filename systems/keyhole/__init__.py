"""One operation through one trocar: its phases, the tube's task, the snake's task."""
