"""All benchmarks, side by side: `python -m tests.benchmarks`, or `make bench`."""

import argparse
import importlib

BENCHMARKS = {
    "speed": "tests.benchmarks.gauze_speed",
    "scenes": "tests.benchmarks.kinematic_scenes",
    "bypass": "tests.benchmarks.bypass_suite",
    "bypass-loop": "tests.benchmarks.bypass_full_loop",
    "snake": "tests.benchmarks.snake_speed",
    "resection": "tests.benchmarks.resection_speed",
    "switching": "tests.benchmarks.switching_suite",
    "wrist_step": "tests.benchmarks.wrist_step",
    "wrist": "tests.benchmarks.wrist_sweep",
}
"""Name and module; each module's `report(seed, scenes)` returns its text."""


def main() -> None:
    """Runs the chosen benchmarks and prints their tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=1, help="of the scenes")
    parser.add_argument("--scenes", type=int, default=300, help="of each kind")
    parser.add_argument(
        "--only", action="append", choices=list(BENCHMARKS), help="all by default"
    )
    arguments = parser.parse_args()
    for name in arguments.only or BENCHMARKS:
        module = importlib.import_module(BENCHMARKS[name])
        print(
            f"\n== {name}: {(module.__doc__ or '').partition(chr(10))[0]}", flush=True
        )
        print(module.report(arguments.seed, arguments.scenes), flush=True)


if __name__ == "__main__":
    main()
