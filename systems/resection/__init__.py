"""Tumour resection (Martin et al.): procedures, feasibility, planning."""
