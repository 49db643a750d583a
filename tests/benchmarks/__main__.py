"""All benchmarks, side by side: `python -m tests.benchmarks`, or `make bench`."""

import argparse

from diagrams.common.scenario import nearest
from tests.benchmarks import (
    bypass_full_loop,
    bypass_suite,
    camera_suite,
    gauze_speed,
    hands,
    joint_offsets,
    kinematic_scenes,
    minutes,
    monitor_sweep,
    organ_suite,
    resection_error,
    resection_speed,
    sensed_step,
    sensed_suite,
    snake_friction,
    snake_speed,
    splitting_suite,
    switching_suite,
    wrist_step,
    wrist_sweep,
)

BENCHMARKS = {
    "speed": gauze_speed,
    "scenes": kinematic_scenes,
    "bypass": bypass_suite,
    "bypass-loop": bypass_full_loop,
    "splitting": splitting_suite,
    "hands": hands,
    "joint-offsets": joint_offsets,
    "organs": organ_suite,
    "camera": camera_suite,
    "snake": snake_speed,
    "snake-friction": snake_friction,
    "resection": resection_speed,
    "resection-error": resection_error,
    "switching": switching_suite,
    "sensed": sensed_suite,
    "sensed-step": sensed_step,
    "wrist-step": wrist_step,
    "wrist": wrist_sweep,
    "monitor": monitor_sweep,
    "minutes": minutes,
}
"""Name and module; each module's `report(seed, scenes)` returns its text."""

TITLES = {
    name: (module.__doc__ or "").partition("\n")[0]
    for name, module in BENCHMARKS.items()
}


def main() -> None:
    """Runs the chosen benchmarks and prints their tables."""
    parser = argparse.ArgumentParser(
        prog="python -m tests.benchmarks",
        description="Runs benchmarks and prints their tables.",
        epilog="\n".join(f"  {name:12} {title}" for name, title in TITLES.items()),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("names", nargs="*", metavar="NAME", help="all by default")
    parser.add_argument("--seed", type=int, default=1, help="of the scenes")
    parser.add_argument("--scenes", type=int, default=300, help="of each kind")
    arguments = parser.parse_args()
    if arguments.scenes < 1:
        parser.error(f"--scenes {arguments.scenes}: must be at least 1")
    for name in arguments.names:
        if name not in BENCHMARKS:
            parser.error(f"NAME={name!r}: {nearest(name, BENCHMARKS)}")
    for name in arguments.names or BENCHMARKS:
        print(f"\n== {name}: {TITLES[name]}", flush=True)
        print(BENCHMARKS[name].report(arguments.seed, arguments.scenes), flush=True)


if __name__ == "__main__":
    main()
