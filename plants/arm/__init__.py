"""The 7-joint PA-10-7C arm."""
