"""What is drawn into a resection's replay."""

from typing import Any


def decorate(meshcat: Any, animation: Any, run: Any) -> None:
    """Tumour that shrinks."""
