"""The entry's closed form: how narrow a hole may be, and when the robot jams.

During the entry modules 1 and 2 are straight. The last module bent by a small b
moves the tool by (6h + 2l) b and its own last plate by (4h + e) b. In a hole that
leaves the body a clearance c the plate may move by c, so the tool cuts the next
hole with a clearance

    c' = lambda c + r - r_b,   lambda = (6h + 2l)/(4h + e).

The plan keeps a clearance between body and tissue and counts on a smaller tool: r_b
is larger by the one, r smaller by the other. The fixed point (r_b - r)/(lambda - 1)
is unstable: a channel with less clearance
makes every hole narrower than the one before, until the robot jams. Voxels are too
coarse to see it, so it is a check of its own.
"""

from plants.snake.parameters import SnakeParams


def opening_ratio(params: SnakeParams) -> float:
    """lambda: the tool's over the last plate's way when the last module bends."""
    h, e, tool = params.half_pitch, params.plate_thickness, params.tool_offset
    return (6 * h + 2 * tool) / (4 * h + e)


def least_clearance(
    params: SnakeParams, kept: float = 0.0, accuracy: float = 0.0
) -> float:
    """Clearance in m that the channel must exceed for the entry to open out.

    Args:
        params: The robot.
        kept: Clearance that the plan keeps between body and tissue, in m.
        accuracy: By which it takes the tool for smaller, in m.
    """
    narrow = params.body_radius + kept - (params.tool_radius - accuracy)
    if narrow <= 0.0:
        return 0.0
    ratio = opening_ratio(params)
    # The channel is bored for the bare body: what is kept comes on top.
    return kept + narrow / (ratio - 1.0) if ratio > 1.0 else float("inf")


def least_radius(params: SnakeParams, clearance: float = 0.5e-3) -> float:
    """Radius in m of the narrowest hole through which the robot can follow."""
    h, e, tool = params.half_pitch, params.plate_thickness, params.tool_offset
    need = params.body_radius + clearance - params.tool_radius
    lever = (6 * h + 2 * tool) - (4 * h + e)
    return params.tool_radius + (6 * h + 2 * tool) * max(need, 0.0) / lever
