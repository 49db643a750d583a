"""Arm, breathing patient, tube and snake in one plant: a tumour resected."""
