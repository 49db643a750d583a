"""What one control instant of the local planner's four blocks costs.

`python -m tests.benchmarks.planner_step` runs them on constant inputs, with all
three behaviours at work, and prints the wall time of updates and outputs.
"""

import argparse
import statistics
import time
from typing import Any

from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource

from systems.auto_guidance.backward_movement import BackwardMovement
from systems.auto_guidance.fuzzy_arbiter import FuzzyArbiter
from systems.auto_guidance.go_to_target import GoToTarget, GoToTargetParams
from systems.auto_guidance.velocity_corrections import VelocityCorrections
from systems.common.signals import (
    OBSTACLE_EXAMPLE,
    ROBOT_TOOL_EXAMPLE,
    TARGET_EXAMPLE,
)


def add_planner(builder: DiagramBuilder, ports: dict[str, Any]) -> dict[str, Any]:
    """Adds the four blocks with their default parameters and connects them by name.

    Args:
        builder: Of the diagram.
        ports: Output ports for `robot_tool`, `obstacle` and `target`.

    Returns:
        These and the blocks' output ports by name.
    """
    ports = dict(ports)
    blocks = [
        builder.AddNamedSystem(kind.__name__, kind())
        for kind in (GoToTarget, VelocityCorrections, BackwardMovement, FuzzyArbiter)
    ]
    for block in blocks:
        for i in range(block.num_output_ports()):
            port = block.get_output_port(i)
            ports[port.get_name()] = port
    for block in blocks:
        for i in range(block.num_input_ports()):
            port = block.get_input_port(i)
            builder.Connect(ports[port.get_name()], port)
    return ports


def wall_per_instant(instants: int, repeats: int) -> list[float]:
    """Mean wall time per control instant, Drake's own included, of each repeat, s."""
    builder = DiagramBuilder()
    examples = {
        "robot_tool": ROBOT_TOOL_EXAMPLE,
        "obstacle": OBSTACLE_EXAMPLE,
        "target": TARGET_EXAMPLE,
    }
    add_planner(
        builder,
        {
            name: builder.AddNamedSystem(
                name, ConstantVectorSource(value)
            ).get_output_port()
            for name, value in examples.items()
        },
    )
    diagram = builder.Build()
    duration = instants * GoToTargetParams().period
    walls = []
    for _ in range(repeats):
        simulator = Simulator(diagram)
        simulator.Initialize()
        start = time.perf_counter()
        simulator.AdvanceTo(duration)
        walls.append((time.perf_counter() - start) / instants)
    return walls


def main() -> None:
    """Prints the least and the median of the repeats."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--instants", type=int, default=600)
    parser.add_argument("--repeats", type=int, default=15)
    args = parser.parse_args()
    walls = wall_per_instant(args.instants, args.repeats)
    print(
        f"local planner, four blocks: {1e6 * min(walls):.0f} us per instant "
        f"(median {1e6 * statistics.median(walls):.0f} us of {args.repeats} repeats)"
    )


if __name__ == "__main__":
    main()
