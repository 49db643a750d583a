"""Runs of campaigns that do nothing, or harm."""

import ctypes
import hashlib
import os
import time
from typing import Any

_KEPT: list[bytes] = []


def act(job: dict[str, Any]) -> dict[str, Any]:
    """Figures of a run's draws alone; `do` says what else it does."""
    told = job["overrides"]
    match told.get("do", "nothing"):
        case "segfault":
            ctypes.string_at(0)
        case "exit":
            raise SystemExit("a demand was not met")
        case "loop":
            while True:
                time.sleep(1.0)
        case "memory":
            hog = []
            while True:
                hog.append(bytearray(100_000_000))
        case "once":  # dies the first time only
            mark = told["mark"]
            if not os.path.exists(mark):
                open(mark, "w").close()
                os.abort()
        case "error":
            raise ValueError("no such thing")
        case "keep":
            _KEPT.append(b"x" * 100_000_000)
        case "slow":
            time.sleep(0.01)
    digest = hashlib.sha256(repr(sorted(told.items())).encode()).digest()
    x = float(told.get("x", 0.0))
    return {
        "x": x,
        "share": digest[0] / 255,
        "list": [x, x],
        "name": "run",
        "ok": x < 1,
    }
