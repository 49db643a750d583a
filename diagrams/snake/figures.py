"""Pictures of the snake that need no run: a bent module, and the workspace."""

from typing import Any

from matplotlib.figure import Figure
import numpy as np
from scipy.ndimage import distance_transform_edt

from diagrams.common.plots import COLORS, add_axes, new_figure
from diagrams.snake.plots import MM, MODULE_COLORS
from plants.snake.actuation import length_range, wire_lengths
from plants.snake.balls import turns_of
from plants.snake.kinematics import forward, frames
from plants.snake.parameters import WIRES, SnakeParams
from plants.snake.posture import posture_of
from plants.snake.wire_path import hanging_points, tangent_points
from systems.common.parameter import check

_TURN = np.linspace(0.0, 2 * np.pi, 49)


def _circle(centre: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Points of a circle with radii x and y about a centre, (n, 3)."""
    return centre + np.outer(np.cos(_TURN), x) + np.outer(np.sin(_TURN), y)


def _draw_ball(axes: Any, centre: np.ndarray, radius: float) -> None:
    u, v = np.meshgrid(_TURN[::3], np.linspace(0, np.pi, 13))
    x = centre[0] + radius * np.cos(u) * np.sin(v)
    y = centre[1] + radius * np.sin(u) * np.sin(v)
    z = centre[2] + radius * np.cos(v)
    axes.plot_surface(x, y, z, color="#cca85c", alpha=0.35, linewidth=0)


def _arc(centre: np.ndarray, B: np.ndarray, C: np.ndarray, radius: float) -> np.ndarray:
    """From B to C on the ball, (n, 3); straight if they are not on it."""
    points = B + np.linspace(0, 1, 12)[:, None] * (C - B)
    off = points - centre
    far = np.linalg.norm(off, axis=1)[:, None]
    return centre + off * np.maximum(1.0, radius / far)


def draw_module(axes: Any, alpha: float, beta: float, params: SnakeParams) -> None:
    """Draws balls, plates and the three wires of one module, in mm.

    Args:
        axes: Three-dimensional axes.
        alpha: Azimuth of the bend in rad.
        beta: Bend of each ball in rad.
        params: The snake.
    """
    x = posture_of([0.0, alpha, beta, 0.0, 0.0, 0.0, 0.0])
    R, d, r = params.ball_radius, params.face, params.body_radius
    sb = np.sin(beta)
    middle = np.array([np.cos(alpha) * sb, np.sin(alpha) * sb, np.cos(beta)])
    axes_of = (np.array([0.0, 0.0, 1.0]), middle, frames(x, params)[1][:3, 2])
    balls = hanging_points(turns_of(x), 0.0, params)[:2]
    for w in range(WIRES):  # through the plate between the balls
        through = np.array([balls[0][2][w], balls[1][1][w]]) * MM
        axes.plot(*through.T, color=MODULE_COLORS[w], lw=2.5, alpha=0.5)
    for ball, (centre, P, P_far) in enumerate(balls):
        _draw_ball(axes, centre * MM, R * MM)
        B, C = tangent_points(centre, P, P_far, params)
        for w in range(WIRES):
            over = _arc(centre, B[w], C[w], R)
            line = np.vstack([P[w], over, P_far[w]]) * MM
            axes.plot(*line.T, color=MODULE_COLORS[w], lw=2.5)
        # The edges of the plates' faces before and after the ball.
        for side, axis in ((-1, axes_of[ball]), (1, axes_of[ball + 1])):
            across = np.linalg.svd(axis[None])[2][1:]
            edge = _circle(centre + side * d * axis, r * across[0], r * across[1]) * MM
            axes.plot(*edge.T, color="#6b737b", lw=1.5)
    half = 4.2 * params.half_pitch * MM / 2
    axes.set(
        xlim=(-half, half),
        ylim=(-half, half),
        zlim=(-0.5 * half, 1.5 * half),
        xlabel="x [mm]",
        ylabel="y [mm]",
        zlabel="z [mm]",
    )
    axes.set_box_aspect((1, 1, 1))
    axes.view_init(elev=14, azim=-70)


def module_figure(
    alpha: float, beta: float, params: SnakeParams | None = None
) -> Figure:
    """One bent module, its wires, and how long they are.

    Args:
        alpha: Azimuth of the bend in rad.
        beta: Bend of each ball in rad, within [0, max_bend].
        params: The snake.

    Raises:
        ValueError: If beta is beyond its limit.
    """
    params = check(params or SnakeParams())
    if not 0.0 <= beta <= params.max_bend + 1e-9:
        raise ValueError(
            f"beta={beta:.4f} rad is outside [0, max_bend={params.max_bend:.4f}] rad; "
            f"nearest {min(max(beta, 0.0), params.max_bend):.4f}"
        )
    figure = new_figure(9.0, 4.4)
    draw_module(add_axes(figure, 1, 2, 1, projection="3d"), alpha, beta, params)
    axes = add_axes(figure, 1, 2, 2)
    L = wire_lengths(posture_of([0.0, alpha, beta, 0, 0, 0, 0]), params)[:WIRES] * MM
    low, high = (limit[:WIRES] * MM for limit in length_range(params))
    straight = params.straight_module * MM
    axes.barh(range(WIRES), high - low, left=low, color=COLORS["muted"], alpha=0.3)
    axes.barh(range(WIRES), L - straight, left=straight, color=MODULE_COLORS[:WIRES])
    axes.axvline(straight, color="k", lw=0.8)
    for w in range(WIRES):
        axes.text(high[w] + 0.2, w, f"{L[w]:.2f} mm", va="center")
    degrees = [round(np.degrees(phi)) for phi in params.azimuths()[0]]
    axes.set_yticks(range(WIRES), [f"wire at {phi}°" for phi in degrees])
    axes.set(xlabel="length [mm], grey: its range", xlim=(low[0] - 0.5, high[0] + 2.6))
    axes.set_title(f"α = {np.degrees(alpha):.0f}°, β = {np.degrees(beta):.0f}°")
    return figure


def reach(
    modules: int, params: SnakeParams, count: int = 400_000, seed: int = 0
) -> np.ndarray:
    """Radius and height of sampled tool positions at s = 0, in m, (count, 2).

    Args:
        modules: How many modules, from the tool backwards, bend: 1 to 3.
        params: The snake.
        count: Number of random postures.
        seed: Of the samples.
    """
    rng = np.random.default_rng(seed)
    q = np.zeros((count, 7))
    for k in range(4 - modules, 4):
        q[:, 2 * k - 1] = rng.uniform(-np.pi, np.pi, count)
        q[:, 2 * k] = params.max_bend * np.sqrt(rng.uniform(0.0, 1.0, count))
    p = forward(posture_of(q), params)[:, :3, 3]
    return np.column_stack([np.hypot(p[:, 0], p[:, 1]), p[:, 2]])


def swept(
    modules: int, params: SnakeParams, cell: float = 0.25e-3
) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """What the tool's ball sweeps at s = 0, in a plane through the axis.

    Args:
        modules: How many modules, from the tool backwards, bend: 1 to 3.
        params: The snake.
        cell: Size of the plane's cells in m.

    Returns:
        Radii (n,), negative on the other side of the axis, and heights (m,) of the
        cells in m, whether each is swept (n, m), and the swept volume in m3.
    """
    r, z = reach(modules, params).T
    half, margin = r.max() + params.tool_radius + 2 * cell, params.tool_radius + cell
    radii = np.arange(-np.ceil(half / cell), np.ceil(half / cell) + 1) * cell
    heights = np.arange(z.min() - 2 * margin, z.max() + 2 * margin, cell)
    i = np.round((r - radii[0]) / cell).astype(int)
    j = np.round((z - heights[0]) / cell).astype(int)
    free = np.ones((len(radii), len(heights)), bool)
    free[i, j] = free[len(radii) - 1 - i, j] = False
    inside = distance_transform_edt(free, sampling=cell) <= params.tool_radius
    volume = float((np.pi * np.abs(radii)[:, None] * inside).sum() * cell**2)
    return radii, heights, inside, volume


def workspace_figure(
    params: SnakeParams | None = None,
) -> tuple[Figure, list[float]]:
    """What the tool's ball can sweep with one, two and three modules bending.

    The translation stands still; with one module this is the elementary volume of
    the paper's Figure 7.

    Args:
        params: The snake.

    Returns:
        The figure, and the volumes in m3 with 1, 2 and 3 modules.
    """
    params = check(params or SnakeParams())
    figure = new_figure(7.0, 4.6)
    axes = add_axes(figure, 1, 1, 1)
    volumes = []
    shades = (COLORS["accent"], COLORS["target"], COLORS["robot"])
    for modules in (3, 2, 1):
        radii, heights, inside, volume = swept(modules, params)
        volumes.append(volume)
        style = {"color": shades[modules - 1], "alpha": 0.75}
        axes.contourf(
            radii * MM,
            heights * MM,
            inside.T.astype(float),
            levels=[0.5, 1.5],
            colors=[style["color"]],
            alpha=style["alpha"],
        )
        axes.fill([], [], label=f"{modules} bending: {1e6 * volume:.0f} cm³", **style)
    axes.plot([0, 0], [0, params.straight_module * 3 * MM], color="k", lw=4)
    axes.set(xlabel="radius [mm]", ylabel="z [mm]", aspect="equal")
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    axes.set_title("what the tool sweeps; black: the robot, straight")
    return figure, volumes[::-1]
