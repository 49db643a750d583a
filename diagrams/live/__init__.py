"""Scenarios run in real time, and whoever watches takes part."""
