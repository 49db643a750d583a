"""The thesis's Figures 4 to 12: potentials, anti-gradients and the statechart."""

from collections.abc import Callable, Sequence
from io import BytesIO
from typing import Any

from matplotlib.figure import Figure
from matplotlib.image import imread
import numpy as np
import pygraphviz

from diagrams.common.plots import COLORS, add_axes, new_figure
from systems.switching import fields
from systems.switching.classical_planner import ClassicalParams, summed_fields
from systems.switching.signals import Seen

GOAL = (1.0, 1.5)
"""Of Figures 4 and 5 [m]."""
OBSTACLE = (1.5, 1.0)
"""Of Figure 6 [m]."""
CENTRE = (1.0, 1.0)
"""Of the helicoid of Figures 9 and 10 [m], with c = 2."""
RHO_0 = 1.0


def _grid(count: int, low: float = 0.0, high: float = 3.0) -> tuple[Any, Any]:
    line = np.linspace(low, high, count)
    return np.meshgrid(line, line)


def surface(
    title: str, potential: Callable[[float, float], float], cap: float
) -> Figure:
    """A potential as a surface over the plane, cut off at `cap`."""
    figure = new_figure(5.5, 4.5)
    axes = add_axes(figure, 1, 1, 1, projection="3d")
    x, y = _grid(70)
    z = np.clip(np.vectorize(potential)(x, y), -cap, cap)
    axes.plot_surface(x, y, z, cmap="viridis", lw=0, antialiased=True, rcount=70)
    axes.set(xlabel="x [m]", ylabel="y [m]", zlabel="potential")
    axes.set_title(title)
    axes.set_box_aspect((1.0, 1.0, 0.7), zoom=0.85)
    return figure


def arrows(
    title: str,
    field: Callable[[float, float], tuple[float, float]],
    centre: Sequence[float],
    longest: float,
) -> Figure:
    """An anti-gradient as arrows, none longer than `longest`."""
    figure = new_figure(5.0, 4.6)
    axes = add_axes(figure, 1, 1, 1)
    x, y = _grid(19, 0.05, 2.95)
    u, v = np.vectorize(field)(x, y)
    size = np.hypot(u, v)
    scale = np.minimum(1.0, longest / np.maximum(size, 1e-9))
    axes.quiver(
        x,
        y,
        scale * u,
        scale * v,
        np.minimum(size, longest),
        cmap="viridis",
        pivot="mid",
        angles="xy",
        scale_units="xy",
        scale=longest / 0.15,
        clim=(0.0, longest),
    )
    axes.plot(*centre, "o", color=COLORS["obstacle"], ms=7)
    axes.set(aspect="equal", xlabel="x [m]", ylabel="y [m]")
    axes.set_title(title)
    return figure


def total_potential(
    axes: Any,
    params: ClassicalParams,
    obstacles: Sequence[Seen],
    goal: Sequence[float],
    low: Sequence[float],
    high: Sequence[float],
) -> None:
    """Draws level lines and directions of the sum of potentials (equation 4).

    Args:
        axes: Where to.
        params: Of the classical method.
        obstacles: What stands in the world.
        goal: x, y [m].
        low: Least x, y [m].
        high: Greatest x, y [m].
    """
    (left, bottom), (right, top), (goal_x, goal_y) = low, high, goal
    x, y = np.meshgrid(np.linspace(left, right, 90), np.linspace(bottom, top, 90))
    z = 0.5 * params.gain * ((x - goal_x) ** 2 + (y - goal_y) ** 2)
    # Saturated attraction: linear beyond the distance at which it is full.
    far = params.speed / params.gain
    distance = np.sqrt(2.0 * z / params.gain)
    z = np.where(distance > far, params.speed * (distance - 0.5 * far), z)
    for _, a, b, radius, _, _ in obstacles:
        rho = np.hypot(x - a, y - b) - radius - params.body_radius
        repulse = np.where(
            rho < params.range,
            0.5
            * params.repulsion
            * (1.0 / np.maximum(rho, 0.05) - 1.0 / params.range) ** 2,
            0.0,
        )
        z = z + repulse
    axes.contourf(x, y, np.minimum(z, 6.0), 30, cmap="Greys", alpha=0.5)
    step = slice(3, None, 6)
    u, v = np.vectorize(
        lambda a, b: summed_fields(params, (a, b), (goal_x, goal_y), obstacles)
    )(x[step, step], y[step, step])
    axes.quiver(x[step, step], y[step, step], u, v, color=COLORS["muted"], pivot="mid")


STATECHART = """digraph {
  rankdir=LR; node [shape=box, style="rounded,filled", fillcolor="#dbe7f5",
  fontname=Helvetica]; edge [fontname=Helvetica, fontsize=10]; compound=true;
  start [shape=point]; attractive [label="attractive"];
  subgraph cluster_bypass { label="bypassing"; fontname=Helvetica; style=rounded;
    omega [label="helicoid about Omega\\nc = +s v a"];
    obstacle [label="helicoid about the obstacle\\nc = -s v rho"];
    omega -> obstacle [label="at P1"]; }
  start -> attractive;
  attractive -> omega [label="obstacle in the tube:\\nsense s, Omega, P1, P2"];
  obstacle -> attractive [label="at P2", constraint=false];
}"""
"""Figure 11: the thesis's statechart."""

FLOWCHART = """digraph {
  node [shape=box, style="rounded,filled", fillcolor="#dbe7f5", fontname=Helvetica];
  edge [fontname=Helvetica, fontsize=10];
  see [label="perceive obstacles within R_v"];
  free [shape=diamond, label="goal's direction free?", fillcolor="#f6e3d3"];
  arcs [label="headings blocked by each obstacle,\\nin its own frame"];
  trap [shape=diamond, label="standing group\\nin the way?", fillcolor="#f6e3d3"];
  any [shape=diamond, label="a heading free?", fillcolor="#f6e3d3"];
  attractive [label="attractive potential"];
  bypass [label="involute-helicoid of the obstacle and side\\nat the end of the arcs"];
  group [label="involute-helicoid of the group's member,
until the goal's ray leads nearer than ever"];
  narrower [label="narrower margin, then slower,\\nthen what is hit last"];
  move [label="velocity to the control law"];
  see -> free; free -> attractive [label="yes"]; free -> arcs [label="no"];
  arcs -> trap; trap -> group [label="yes"]; trap -> any [label="no"];
  any -> bypass [label="yes"]; any -> narrower [label="no"]; narrower -> move;
  attractive -> move; bypass -> move; group -> move;
}"""
"""Figure 12: one step of the switching planner."""


def chart(text: str, width: float, height: float) -> Figure:
    """A graphviz text as a figure."""
    graph = pygraphviz.AGraph(text)
    graph.graph_attr["dpi"] = "160"
    picture = imread(BytesIO(graph.draw(format="png", prog="dot")))
    figure = new_figure(width, height)
    axes = add_axes(figure, 1, 1, 1)
    axes.imshow(picture)
    axes.axis("off")
    return figure


def thesis_figures() -> dict[str, Figure]:
    """Figures 4, 5, 6, 9, 10, 11 and 12 by file name; 7 and 8 belong to runs."""

    def helix() -> Figure:
        figure = new_figure(5.0, 4.5)
        axes = add_axes(figure, 1, 1, 1, projection="3d")
        r, xi = np.meshgrid(np.linspace(0.0, 1.0, 12), np.linspace(0.0, 4 * np.pi, 160))
        x, y, z = np.vectorize(fields.helicoid_point)(r, xi, 2.0)
        axes.plot_surface(x + 1.0, y + 1.0, z, cmap="viridis", rcount=160, lw=0)
        axes.set(xlabel="x [m]", ylabel="y [m]", zlabel="z")
        axes.set(xticks=(0.0, 1.0, 2.0), yticks=(0.0, 1.0, 2.0))
        axes.set_title("Figure 9a: helicoid, c = 2 (equation 5)")
        axes.set_box_aspect((1.0, 1.0, 1.1), zoom=0.82)
        return figure

    gx, gy = GOAL
    ox, oy = OBSTACLE
    cx, cy = CENTRE
    return {
        "figure_04": surface(
            "Figure 4: attractive potential (equation 1)",
            lambda x, y: fields.attractive_potential(x - gx, y - gy),
            10.0,
        ),
        "figure_05": arrows(
            "Figure 5: its anti-gradient (equation 2)",
            lambda x, y: fields.attractive_field(x - gx, y - gy),
            GOAL,
            3.0,
        ),
        "figure_06a": surface(
            "Figure 6a: repulsive potential (equation 3, squared)",
            lambda x, y: fields.repulsive_potential(
                max(np.hypot(x - ox, y - oy), 0.05), RHO_0
            ),
            8.0,
        ),
        "figure_06b": arrows(
            "Figure 6b: its anti-gradient",
            lambda x, y: fields.repulsive_field(x - ox, y - oy, 0.0, RHO_0),
            OBSTACLE,
            2.0,
        ),
        "figure_09a": helix(),
        "figure_09b": surface(
            "Figure 9b: bypassing potential, c = 2 (equation 6)",
            lambda x, y: fields.helicoid_potential(x - cx, y - cy, 2.0),
            8.0,
        ),
        "figure_10": arrows(
            "Figure 10: its anti-gradient (equation 7), clockwise",
            lambda x, y: fields.helicoid_field(x - cx, y - cy, 2.0),
            CENTRE,
            4.0,
        ),
        "figure_10_involute": arrows(
            "The involute-helicoid, rho = 0.5 m, clockwise",
            lambda x, y: fields.involute_field(x - cx + 1e-9, y - cy, 0.5, -1.0),
            CENTRE,
            1.0,
        ),
        "figure_11": chart(STATECHART, 8.0, 2.6),
        "figure_12": chart(FLOWCHART, 6.5, 7.5),
    }
