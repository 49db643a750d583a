"""Plots of the passive wrist."""

from typing import Any


def plots(run: Any) -> dict[str, Any]:
    """All plots of a run, by file name."""
    return {}
