"""Scenarios that nobody would write: each is run-able, or refused in one line.

`python -m tests.fuzz --cases 20000` mutates the shipped scenarios and loads them; it
says what was neither a scenario nor a ScenarioError, and what absurd value was taken.
"""

import argparse
from collections import Counter
from collections.abc import Iterator
from copy import deepcopy
from dataclasses import dataclass, field
from pathlib import Path
import random
import sys
import tempfile
from typing import Any

import yaml

from diagrams.common.scenario import ScenarioError, scenario_files
from diagrams.common.tree import read_tree
from diagrams.studies import load_scenario
from systems.common.parameter import keys

ABSURD = (1e9, 1e300, -1e9, -1e300)
"""No quantity of an operating theatre in SI units."""

VALUES: tuple[Any, ...] = (
    *(0, -1, 1e-300, -0.0, True, None, "", "nan", "on", "1e400", "a\0b", "/dev/zero"),
    *(float("nan"), float("inf"), 10**400, -(10**400), 2**64, "9" * 400, "ä" * 300),
    *([], {}, [[]], [0.0] * 3, [[0.0] * 3] * 40, {3: 1}, {"": {}}, [None], "."),
)


@dataclass
class Found:
    """What mutated scenarios came to.

    Attributes:
        refused: How many were refused with a ScenarioError.
        accepted: How many were scenarios.
        escaped: Other exceptions, and the mutation.
        absurd: Absurd values that were accepted, by key.
    """

    refused: int = 0
    accepted: int = 0
    escaped: list[str] = field(default_factory=list)
    absurd: Counter[str] = field(default_factory=Counter)

    def __str__(self) -> str:
        """The figures in a few lines."""
        lines = [f"{self.refused} refused, {self.accepted} accepted"]
        lines += [f"{len(self.escaped)} escaped", *self.escaped]
        lines += [f"{len(self.absurd)} keys took absurd values"]
        lines += [f"  {key}: {count}" for key, count in self.absurd.most_common()]
        return "\n".join(lines)


def places(node: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Where the values of plain data are, each as the keys that lead there."""
    items = node.items() if isinstance(node, dict) else ()
    for key, item in enumerate(node) if isinstance(node, list) else items:
        yield (*path, key)
        yield from places(item, (*path, key))


def mutated(tree: dict[str, Any], known: list[str], rng: random.Random) -> str:
    """Changes one or two things in a scenario, in place; says what."""
    told = []
    for _ in range(rng.choice((1, 1, 2))):
        value = deepcopy(rng.choice(rng.choice((ABSURD, VALUES))))
        kind = rng.choice(("value", "scale", "key", "rename", "drop"))
        found = list(places(tree))
        if kind == "key" or not found:
            path: tuple[Any, ...] = tuple(rng.choice(known).split("."))
        else:
            path = rng.choice(found)
        node: Any = tree
        for part in path[:-1]:
            node = node.setdefault(part, {}) if isinstance(node, dict) else node[part]
            if not isinstance(node, dict | list):
                break
        old = node[path[-1]] if kind in ("value", "scale") and path in found else None
        if kind == "scale" and type(old) in (int, float):
            value = old * rng.choice((-1, 0.1, 0.5, 1.5, 2, 10, 100))
        if isinstance(node, dict) and kind == "rename" and path[-1] in node:
            node[rng.choice((f"{path[-1]}x", 7, "", None))] = node.pop(path[-1])
        elif isinstance(node, dict) and kind == "drop":
            node.pop(path[-1], None)
        elif isinstance(node, dict) or (
            isinstance(node, list) and isinstance(path[-1], int)
        ):
            node[path[-1]] = value
        told.append(f"{kind} {'.'.join(map(str, path))} {value!r:.40}")
    return "; ".join(told)


def absurd_keys(scenario: Any) -> list[str]:
    """Keys of a scenario that have an absurd number, or one beyond their bounds."""
    found = []
    for key in keys(scenario):
        value, told = key.value, key.parameter
        if value is None or isinstance(value, str | bool):
            continue
        flat, numbers = [value], []
        while flat:
            item = flat.pop()
            flat += item if isinstance(item, list) else []
            numbers += [item] if isinstance(item, int | float) else []
        # A seed may have any of 64 bits; of other numbers these are absurd.
        is_seed = key.name.rpartition(".")[2].endswith("seed")
        large = any(abs(n) >= min(map(abs, ABSURD)) for n in numbers) and not is_seed
        if large or not (key.value == key.default or told.holds(value)):
            found.append(key.name)
    return found


def fuzz(cases: int, seed: int, folder: Path) -> Found:
    """Loads so many mutated scenarios.

    Args:
        cases: Number of mutations.
        seed: Of them.
        folder: To write them to.
    """
    rng, found = random.Random(seed), Found()
    files = scenario_files()
    trees = {name: read_tree(path) for name, path in files.items()}
    names = sorted(trees)
    known = {n: [key.name for key in keys(load_scenario(n))] for n in names}
    for case in range(cases):
        name = names[case % len(names)]
        tree = deepcopy(trees[name])
        told = f"{name}: {mutated(tree, known[name], rng)}"
        path = folder / "mutated.yaml"
        path.write_text(yaml.dump(tree, allow_unicode=True), encoding="utf-8")
        try:
            scenario = load_scenario(str(path))
        except ScenarioError:
            found.refused += 1
        except Exception as error:
            found.escaped.append(f"{told}: {type(error).__name__}: {error}")
        else:
            found.accepted += 1
            found.absurd.update(absurd_keys(scenario))
    return found


def main() -> int:
    """Runs the command line; 1 if anything was found."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("--cases", type=int, default=20_000)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        found = fuzz(arguments.cases, arguments.seed, Path(folder))
    print(found)
    return int(bool(found.escaped or found.absurd))


if __name__ == "__main__":
    sys.exit(main())
