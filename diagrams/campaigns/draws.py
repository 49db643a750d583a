"""Draws of several keys that depend on one another, by the name of `Campaign.draw`."""

from collections.abc import Callable
from itertools import pairwise
from math import cos, pi, sin, sqrt
from typing import Any

from diagrams.campaigns.tape import Tape
from plants.abdomen.wall_motion import WallMotionParams
from systems.common.geometry import (
    along,
    closest_on_segment,
    closest_points,
    norm,
    plus,
    scaled,
    sub,
    unit,
)
from systems.common.signal import Vector, vector

_PEOPLE = (5, 10, 15, 20, 30, 40)
_TRIES = 400
_LEAST_WAY = 0.03
"""Of the robot's tip [m]."""
_CLEAR = 0.012
"""Axes of the tools at the start, and where both tools end [m]."""
_OUTSIDE = 0.3
"""Of a tool, at the most [m]."""
_APART = 0.06
"""Trocars of two tools [m]."""
_ROOM = 0.03
"""Of the other tool round the robot's trocar [m]."""


def _tip(tape: Tape, key: str, trocar: Vector, tilt: float) -> Vector:
    """A tip even in depth and in the cone below a trocar, 80 to 160 mm inside."""
    depth = tape.uniform(f"{key}.depth", 0.08, 0.16)
    lean = tilt * sqrt(tape.share(f"{key}.tilt"))
    turn = tape.uniform(f"{key}.turn", 0.0, 2.0 * pi)
    x, y, z = trocar
    r = depth * sin(lean)
    return x + r * cos(turn), y + r * sin(turn), z - depth * cos(lean)


def _trocar(tape: Tape, key: str, least: float, most: float) -> Vector:
    """A trocar on the wall, in a ring round the robot's own."""
    r = tape.uniform(f"{key}.r", least, most)
    turn = tape.uniform(f"{key}.turn", 0.0, 2.0 * pi)
    return r * cos(turn), r * sin(turn), 0.0


def _near(tape: Tape, way: list[Vector]) -> Vector:
    """A point about the robot's way: 15 mm off it in each direction."""
    p = along(way[0], tape.share("along"), sub(way[1], way[0]))
    return plus(p, vector([0.015 * tape.normal(f"off.{axis}") for axis in "xyz"]))


def _wander(
    tape: Tape, trocar: Vector, way: list[Vector], start: float
) -> tuple[list[float], list[Vector]]:
    """Times and points of a hand: rests and ways at 10 to 60 mm/s at the most.

    Seven of ten hands come to where the robot goes.
    """
    comes = tape.share("comes") < 0.7
    speed = tape.uniform("speed", 0.01, 0.06)
    time, tip = start, _tip(tape, "0", trocar, 0.7)
    times, points = [time], [tip]
    for leg in range(1, 6):
        time += max(0.1, tape.uniform(f"{leg}.rest", -1.0, 1.0))
        times, points = [*times, time], [*points, tip]
        there = _tip(tape, f"{leg}", trocar, 0.7)
        if comes and leg == 1:
            there = _near(tape.under("near"), way)
        # From rest to rest the hand is half as fast again as on average.
        time += 0.1 + 1.5 * norm(sub(there, tip)) / speed
        tip = there
        times, points = [*times, time], [*points, tip]
        if time > start + 6.0:
            break
    return times, points


def _between(points: list[Vector]) -> list[Vector]:
    if len(points) == 1:
        return points
    return [along(a, k / 8, sub(b, a)) for a, b in pairwise(points) for k in range(9)]


def _keeps_off(points: list[Vector], trocar: Vector) -> bool:
    """Whether a tool leaves room round the robot's trocar, at the world's origin."""
    origin = (0.0, 0.0, 0.0)
    tips = _between(points)
    return all(closest_on_segment(origin, trocar, p)[1] > _ROOM for p in tips)


def _apart_outside(
    points: list[Vector],
    trocar: Vector,
    way: list[Vector],
    g: Vector = (0.0, 0.0, 0.0),
) -> bool:
    """Whether the tools' parts outside the body stay clear of one another.

    The planner knows of what is inside only; whoever holds the tools sees to the rest.
    """
    mine = [_outside(g, p) for p in _between(way)]
    theirs = [_outside(trocar, p) for p in _between(points)]
    return all(
        closest_points(g, a, trocar, b).distance > _CLEAR for a in mine for b in theirs
    )


def _at_start(patient: dict[str, Any]) -> Vector:
    """Where the robot's trocar is at the start: the patient has drawn breath."""
    keys = ("breathing", "phase", "wave")
    told = {key: patient[f"wall_motion.{key}"] for key in keys}
    return vector(WallMotionParams(**told).displacement(0.0))


def _outside(trocar: Vector, tip: Vector) -> Vector:
    """The outer end of a tool."""
    return along(trocar, _OUTSIDE, unit(sub(trocar, tip)))


def _way(tape: Tape, g: Vector) -> tuple[Vector, Vector]:
    """Where the robot starts and where it is wanted."""
    for pose in tape.tries("pose", _TRIES):
        start, goal = _tip(pose, "start", g, 0.55), _tip(pose, "goal", g, 0.5)
        if norm(sub(goal, start)) >= _LEAST_WAY:
            break
    return start, goal


def _surgeons(tape: Tape, g_o: Vector) -> Vector:
    """The trocar of S, not beside the hand's."""
    for surgeon in tape.tries("surgeon", _TRIES):
        g_s = _trocar(surgeon, "trocar", _APART, 0.15)
        if norm(sub(g_s, g_o)) > _APART:
            break
    return g_s


def _direction(tape: Tape, key: str) -> Vector:
    return unit(vector([tape.normal(f"{key}.{axis}") for axis in "xyz"]))


def operation(tape: Tape) -> dict[str, Any]:
    """A delivery of gauze: where the tools are, and how the surgeon's hand moves.

    Robot, target and hand are anywhere that the arm, 0.6 rad of tilt and 80 to 160 mm
    of depth allow, the robot's way 30 mm or longer. The hand wanders for six seconds
    from the first one on, 30 mm off the robot's trocar, and ends where it leaves the
    target free by 7 mm; seven of ten come to where the robot goes. The tools do not
    cross outside the body. The wall breathes; the first guess of the fulcrum is up to
    20 mm wrong; in three of ten the tracker loses sight of the hand, in one of ten the
    wall is pushed.
    """
    g, patient = (0.0, 0.0, 0.0), _patient(tape)
    g_0 = _at_start(patient)
    start, goal = _way(tape, g)
    for hand in tape.tries("hand", _TRIES):
        g_o = _trocar(hand, "trocar", _APART, 0.13)
        times, points = _wander(hand, g_o, [start, goal], 1.0)
        is_clear = (
            closest_points(g_0, start, g_o, points[0]).distance > _CLEAR
            and _apart_outside(points[:1], g_o, [start], g_0)
            and closest_points(g, goal, g_o, points[-1]).distance > _CLEAR
        )
        if (
            is_clear
            and _keeps_off(points, g_o)
            and _apart_outside(points, g_o, [start, goal])
        ):
            break
    g_s = _surgeons(tape, g_o)
    eye = _eye(g_o, g_s)
    return {
        "robot.p_WP": list(start),
        "target.p_WG": list(g_s),
        "target.times": [0.0],
        "target.points": [list(goal)],
        "obstacle.p_WG": list(g_o),
        "obstacle.times": times,
        "obstacle.points": [list(p) for p in points],
        "camera.p_WG": eye,
        "camera.p_WS": [goal[0], goal[1], goal[2]],
        **patient,
    }


def theatre(tape: Tape) -> dict[str, Any]:
    """A synthetic hand at up to 250 mm/s where everything breathes.

    Robot and target are anywhere that `operation` has them; the hand begins beside the
    robot's way, and goes where it likes. The tracker is 2 mm and half a degree off, the
    first guess of the fulcrum 10 mm.
    """
    g, patient = (0.0, 0.0, 0.0), _breath(tape)
    g_0 = _at_start(patient)
    start, goal = _way(tape, g)
    for hand in tape.tries("hand", _TRIES):
        g_o = _trocar(hand, "trocar", _APART, 0.13)
        tip = _near(hand, [start, goal])
        is_clear = closest_points(g_0, start, g_o, tip).distance > _CLEAR
        if is_clear and _apart_outside([tip], g_o, [start], g_0):
            break
    g_s = _surgeons(tape, g_o)
    off, turn = _direction(tape, "registration"), _direction(tape, "registration.turn")
    return {
        "robot.p_WP": list(start),
        "target.p_WG": list(g_s),
        "target.times": [0.0],
        "target.points": [list(goal)],
        "target.lag": tape.uniform("target.lag", 0.0, 0.5),
        "obstacle.p_WG": list(g_o),
        "obstacle.times": [0.0],
        "obstacle.points": [list(tip)],
        "obstacle.hand.seed": 1 + tape.whole("hand.seed", 1_000_000),
        "obstacle.lag": tape.uniform("hand.lag", 0.0, 0.5),
        "camera.p_WG": _eye(g_o, g_s),
        "camera.p_WS": list(goal),
        "first_guess": list(scaled(0.01, _direction(tape, "guess"))),
        "tracker.shift": list(scaled(0.002, off)),
        "tracker.turn": list(scaled(0.0087, turn)),
        **patient,
    }


def crowd(tape: Tape) -> dict[str, Any]:
    """A crowd of 5 to 40 people that crosses a circle, a world of its own.

    Twenty just find room on CrowdNav's circle of 4 m; more have a wider one, with as
    much of it for each, and the robot a longer way and time.
    """
    people = _PEOPLE[tape.whole("people", len(_PEOPLE))]
    circle = max(4.0, people / 5)
    return {
        "crowd.people": people,
        "crowd.seed": tape.whole("seed", 1_000_000),
        "crowd.circle": circle,
        "start": [0.0, -circle],
        "goal": [0.0, circle],
        "duration": 10.0 * circle,
    }


def _eye(g_o: Vector, g_s: Vector) -> list[float]:
    """A trocar of the endoscope away from the others, of eight in a ring."""
    ring: list[Vector] = [
        (0.17 * cos(k * pi / 4), 0.17 * sin(k * pi / 4), 0.0) for k in range(8)
    ]
    taken: list[Vector] = [(0.0, 0.0, 0.0), g_o, g_s]

    rooms = [min(norm(sub(p, one)) for one in taken) for p in ring]
    return list(ring[rooms.index(max(rooms))])


def _breath(tape: Tape) -> dict[str, Any]:
    """How the patient breathes."""
    across = tape.uniform("breath.across", 0.0, 0.006)
    turn = tape.uniform("breath.turn", 0.0, 2.0 * pi)
    deep = tape.uniform("breath.deep", 0.0, 0.009)
    return {
        "wall_motion.breathing": [across * cos(turn), across * sin(turn), deep],
        "wall_motion.rate": tape.uniform("breath.rate", 0.15, 0.4),
        "wall_motion.phase": tape.uniform("breath.phase", 0.0, 1.0),
        "wall_motion.wave": ("sine", "ventilator")[tape.whole("breath.wave", 2)],
    }


def _patient(tape: Tape) -> dict[str, Any]:
    """How the patient breathes, how wrong the first guess is, what is not seen."""
    off = tape.uniform("guess.size", 0.0, 0.02)
    values: dict[str, Any] = {
        "first_guess": list(scaled(off, _direction(tape, "guess"))),
        **_breath(tape),
        "abdomen.stiffness": tape.uniform("wall.stiffness", 300.0, 1200.0),
        "tracker.body.noise": tape.uniform("tracker.noise", 5e-5, 4e-4),
        "obstacle.tremor_rms": tape.uniform("hand.tremor", 0.0, 1.5e-4),
    }
    if tape.share("loss") < 0.3:
        start = tape.uniform("loss.start", 1.6, 7.0)
        end = start + tape.uniform("loss.length", 0.1, 1.5)
        loss = {"start": start, "end": end, "tools": ["obstacle"]}
        values["tracker.losses"] = [loss]
    if tape.share("push") < 0.1:
        side = tape.uniform("push.turn", 0.0, 2.0 * pi)
        size = tape.uniform("push.size", 0.001, 0.005)
        values["wall_motion.step"] = [size * cos(side), size * sin(side), 0.0]
        values["wall_motion.step_time"] = tape.uniform("push.time", 3.0, 8.0)
        # Within a sample it would be a load that no arm can go before.
        values["wall_motion.step_duration"] = tape.uniform("push.length", 0.1, 0.5)
    return values


DRAWS: dict[str, Callable[[Tape], dict[str, Any]]] = {
    "": lambda tape: {},
    "operation": operation,
    "theatre": theatre,
    "crowd": crowd,
}
