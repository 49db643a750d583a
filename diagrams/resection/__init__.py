"""The wire-driven snake and the resection of a tumour."""
