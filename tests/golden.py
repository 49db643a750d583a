"""Golden figures: what every scenario measures, held to a part in 1e9.

`python -m tests.golden` runs all scenarios and says what differs from the table in
`golden.json`; with `--write` the table is made anew (`make golden`).
"""

import argparse
import json
from math import isclose
from pathlib import Path
import sys
from typing import Any

from diagrams.common.metrics import WALL_CLOCK
from tests.runs import run

TABLE = Path(__file__).with_name("golden.json")
ROUGH = {"gauze_dynamic_real": 0.05, "gauze_press": 0.05, "snake_unstable": 0.05}
"""Rows that hang on rounding, and to which part they are held.

A parameter that is changed by a part in 1e13 moves a figure of the first by up to three
per cent, and another processor moves both; the snake falls off an unstable equilibrium.
"""


def golden() -> dict[str, dict[str, Any]]:
    """The table: the figures of every scenario that is shipped with what it needs.

    A row's key is the scenario's name, and overrides after it.
    """
    table: dict[str, dict[str, Any]] = json.loads(TABLE.read_text())
    return table


def figures(row: str) -> dict[str, Any]:
    """What the scenario of a row measures now, as the table has it."""
    metrics = {
        k: v for k, v in run(*row.split()).metrics.items() if k not in WALL_CLOCK
    }
    kept: dict[str, Any] = json.loads(json.dumps(metrics))
    return kept


def strayed(row: str, old: Any, new: Any) -> list[str]:
    """The `differences` of a row from the table's."""
    return differences(old, new, row, ROUGH.get(row, 1e-9))


def differences(old: Any, new: Any, at: str = "", part: float = 1e-9) -> list[str]:
    """A line for every key or value in which two trees of figures differ.

    Args:
        old: A tree.
        new: Another.
        at: What the lines begin with.
        part: By which numbers may differ.
    """
    if isinstance(old, dict) and isinstance(new, dict):
        found = [f"{at}.{key}: gone" for key in old.keys() - new.keys()]
        found += [f"{at}.{key}: new" for key in new.keys() - old.keys()]
        for key in old.keys() & new.keys():
            found += differences(old[key], new[key], f"{at}.{key}", part)
        return sorted(found)
    if isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        pairs = enumerate(zip(old, new, strict=True))
        return [d for i, pair in pairs for d in differences(*pair, f"{at}[{i}]", part)]
    if type(old) is type(new) is float:
        same = isclose(old, new, rel_tol=part, abs_tol=1e-9)
    else:
        same = old == new
    return [] if same else [f"{at}: {old!r} -> {new!r}"]


def main() -> int:
    """Runs the command line; 1 if a figure differs."""
    parser = argparse.ArgumentParser(prog="python -m tests.golden", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help="all by default")
    parser.add_argument("--write", action="store_true", help="make the table anew")
    arguments = parser.parse_args()
    table, found = golden(), []
    for name in arguments.names or list(table):
        now = figures(name)
        lines = strayed(name, table.get(name, {}), now)
        print(f"{name}: {len(lines) or 'no'} differences")
        print(*(f"  {line}\n" for line in lines), sep="", end="", flush=True)
        found += lines
        table[name] = now
    if arguments.write:
        rows = [f"{json.dumps(n)}: {json.dumps(table[n])}" for n in sorted(table)]
        TABLE.write_text("{\n" + ",\n".join(rows) + "\n}\n")
    return int(bool(found) and not arguments.write)


if __name__ == "__main__":
    sys.exit(main())
