"""What made a result: the project's version and commit, and the libraries'."""

from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
import platform
import subprocess
from typing import Any

ROOT = Path(__file__).parents[2]
LIBRARIES = ("drake", "numpy", "scipy", "numba")


def release() -> str:
    """The version of the project; "" of a tree that is not installed."""
    try:
        return version("trocar")
    except PackageNotFoundError:
        return ""


@cache
def commit() -> str:
    """The commit of the tree that runs, `+` behind it if files differ; "" if none."""
    if not (ROOT / ".git").exists():
        return ""
    command = ["git", "-C", str(ROOT), "describe", "--always", "--dirty=+"]
    command += ["--exclude=*", "--abbrev=12"]
    try:
        told = subprocess.run(command, capture_output=True, text=True, timeout=10.0)
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return told.stdout.strip() if told.returncode == 0 else ""


def provenance() -> dict[str, Any]:
    """Version, commit, and versions of what the figures depend on."""
    return {
        "trocar": release(),
        "commit": commit(),
        "python": platform.python_version(),
        "machine": platform.machine(),
        **{library: version(library) for library in LIBRARIES},
    }
