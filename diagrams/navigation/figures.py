"""The thesis's Figures 4 to 11: potentials, anti-gradients and the statechart."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from io import BytesIO
from typing import Any

from matplotlib.figure import Figure
from matplotlib.image import imread
from matplotlib.patches import Circle
import numpy as np
import pygraphviz

from diagrams.common.plots import COLORS, add_axes, new_figure
from systems.switching import fields
from systems.switching.classical_planner import (
    ClassicalParams,
    field_sum,
    summed_fields,
)
from systems.switching.signals import Seen
from systems.switching.statechart_planner import (
    ROUND_OBSTACLE,
    TO_CIRCLE,
    Manoeuvre,
    StatechartParams,
    statechart_step,
)

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
    cap = 6.0
    if params.clipped:  # linear beyond the distance at which it is full
        far = params.speed / params.gain
        distance = np.sqrt(2.0 * z / params.gain)
        z = np.where(distance > far, params.speed * (distance - 0.5 * far), z)
    else:
        cap = float(np.quantile(z, 0.9))
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
    axes.contourf(x, y, np.minimum(z, cap), 30, cmap="Greys", alpha=0.5)
    step = slice(3, None, 6)
    u, v = np.vectorize(
        lambda a, b: summed_fields(params, (a, b), (goal_x, goal_y), obstacles)
    )(x[step, step], y[step, step])
    axes.quiver(x[step, step], y[step, step], u, v, color=COLORS["muted"], pivot="mid")


def field_along(
    params: ClassicalParams,
    obstacles: Sequence[Seen],
    start: Sequence[float],
    goal: Sequence[float],
) -> Figure:
    """The sum's size along the straight way, for several forms of its parts."""
    figure = new_figure(6.0, 4.0)
    axes = add_axes(figure, 1, 1, 1)
    (x, y), (gx, gy) = start, goal
    share = np.linspace(0.02, 0.98, 1200)
    way = np.hypot(gx - x, gy - y)
    forms = {
        f"(1), Khatib, gain {params.repulsion:g}": params,
        "(1), Khatib, gain 0.01": replace(params, repulsion=0.01),
        "(1), (3) as printed": replace(params, form="printed"),
        "(1) clipped, Khatib, gain 0.01": replace(params, repulsion=0.01, clipped=True),
    }
    for (name, form), style in zip(forms.items(), ("-", "--", ":", "-."), strict=True):
        places = [(x + s * (gx - x), y + s * (gy - y)) for s in share]
        sums = [field_sum(form, place, (gx, gy), obstacles) for place in places]
        axes.semilogy(share * way, np.hypot(*np.transpose(sums)), style, label=name)
    axes.set(xlabel="along the way [m]", ylabel="size of the sum [m/s]")
    axes.set_ylim(1e-3, None)
    axes.legend(loc="lower right")
    return figure


ALONE = Seen(0.0, 4.0, 0.3, 0.5, 0.0, 0.0)
"""The obstacle of Figure 7 and of the notes' two cases."""
WAY = ((0.0, 0.0), (8.0, 0.0))
"""Start and goal there [m]."""
SIGHT = 1.8
"""How far the robot of the two cases sees [m]."""


def sum_round_one() -> Figure:
    """Figure 7: the sum of potentials leads round one obstacle."""
    figure = new_figure(6.5, 3.6)
    axes = add_axes(figure, 1, 1, 1)
    params = ClassicalParams(clipped=False, repulsion=0.1)
    start, goal = WAY
    total_potential(axes, params, [ALONE], goal, (-0.5, -2.0), (8.5, 2.0))
    way = [start]
    while np.hypot(way[-1][0] - goal[0], way[-1][1]) > 0.02 and len(way) < 4000:
        x, y = way[-1]
        vx, vy = summed_fields(params, (x, y), goal, [ALONE])
        way.append((x + 0.01 * vx, y + 0.01 * vy))
    axes.plot(*np.transpose(way), color=COLORS["accent"], lw=2)
    axes.add_patch(Circle((ALONE.x, ALONE.y), ALONE.radius, color=COLORS["obstacle"]))
    axes.plot(*goal, "*", color=COLORS["target"], ms=12)
    axes.set(aspect="equal", xlabel="x [m]", ylabel="y [m]")
    axes.set_title("Figure 7: the sum of potentials leads round one obstacle")
    return figure


def two_cases() -> Figure:
    """The two cases of the thesis's notes, with their names, as reconstructed."""
    figure = new_figure(7.5, 4.2)
    axes = add_axes(figure, 1, 1, 1)
    params, (start, goal) = StatechartParams(), WAY
    m, (x, y), begun = Manoeuvre(), start, Manoeuvre()
    ways: dict[float, list[tuple[float, float]]] = {}
    switches = []
    while np.hypot(x - goal[0], y - goal[1]) > 0.05:
        before = m.state
        near = np.hypot(x - ALONE.x, y - ALONE.y) < SIGHT
        seen = [ALONE] if near else []
        vx, vy, m = statechart_step(params, m, (x, y), goal, seen)
        if m.state != before:
            switches.append((x, y))
        begun = m if m.state == TO_CIRCLE else begun
        ways.setdefault(m.state + 10 * len(switches), []).append((x, y))
        x, y = x + 0.01 * vx, y + 0.01 * vy
    names = {0.0: "attractive", TO_CIRCLE: "about Omega", ROUND_OBSTACLE: "about O"}
    for key, way in ways.items():
        axes.plot(*np.transpose(way), lw=2.5, label=names[key % 10])
    a, rho = abs(begun.c_omega) / params.speed, abs(begun.c_o) / params.speed
    for (cx, cy), radius in (
        ((begun.omega_x, begun.omega_y), a),
        ((begun.o_x, begun.o_y), rho),
    ):
        axes.add_patch(Circle((cx, cy), radius, fill=False, ls=":", color="k"))
    axes.add_patch(Circle((ALONE.x, ALONE.y), ALONE.radius, color=COLORS["obstacle"]))
    (case_1, _, case_2) = switches
    sense = "counter-clockwise" if begun.side > 0.0 else "clockwise"
    for text, place, off in (
        (f"case 1: {sense} about O", case_1, (-2.4, 0.3)),
        ("P1", (begun.p1_x, begun.p1_y), (-0.5, -0.05)),
        ("P2", (begun.p2_x, begun.p2_y), (0.05, -0.4)),
        ("case 2: attractive again", case_2, (0.6, -0.5)),
        (f"O, c = {begun.c_o:.2f}", (begun.o_x, begun.o_y), (-0.5, 0.95)),
        (
            f"x_Omega, y_Omega; c = {begun.c_omega:.2f}",
            (begun.omega_x, begun.omega_y),
            (-0.4, 0.2),
        ),
    ):
        axes.plot(*place, "o", color="k", ms=4)
        spot = (place[0] + off[0], place[1] + off[1])
        axes.annotate(text, place, spot, fontsize=8)
    axes.plot(*goal, "*", color=COLORS["target"], ms=12)
    axes.set(aspect="equal", xlabel="x [m]", ylabel="y [m]", xlim=(-0.5, 8.5))
    axes.set_ylim(-3.2, 1.6)
    axes.set_title("The notes' two cases, our reconstruction")
    axes.legend(loc="lower left")
    return figure


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
"""The states of the thesis's Figure 11; what the arrows say is our reconstruction."""

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
"""One step of the switching planner. The thesis's Figure 12 is empty on our copy."""


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
    """Figures 4 to 7 and 9 to 11 by file name, and ours; 8 belongs to a run."""

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
        "figure_07": sum_round_one(),
        "notes_two_cases": two_cases(),
        "switching_step": chart(FLOWCHART, 6.5, 7.5),
    }
