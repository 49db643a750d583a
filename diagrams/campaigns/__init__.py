"""Campaigns: a scenario varied and run thousands of times, and how sure that is."""
