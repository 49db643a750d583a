"""Planning a resection: procedures, feasibility, sessions, the planner."""
