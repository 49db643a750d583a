"""Auto-guided movements (Bauzano et al.): the local planner and its sensors."""
