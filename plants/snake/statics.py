"""Statics of the snake as it is: six balls that turn freely, wires, core and load.

The paper lets both balls of a module turn alike and without torsion, and says of the
latter that "a gap can remain according to the robot configuration and must be
considered in a static model". Here ball i turns by any R_i; equations (2) and (3)
hold as they are, since they depend on the chord p = ||P P'|| across a ball alone:

    p^2 = 2 (rho^2 - P . R_i c),   P = R (cos, sin) - d z,   c = R (cos, sin) + d z
    f(p) = p + e  or  2h + 2R [asin(p / 2 rho) - atan(d / R)],   L_w = sum f

With R_i exp(delta) and r = R_i^T P, P . R_i c has the gradient c x r and the Hessian
sym(r c^T) - (r . c) I. The energy of wires, core, weight and tool force is

    E = sum T^2 / 2k  or  sum T L,  T = max(T_0, pull + k (L - L_d)),  + ...

Where it is least the snake stays; an eigenvalue of its Hessian that is not positive
says that it does not, though it be in balance.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from plants.snake.core import SnakeCoreParams
from plants.snake.drive import SnakeDriveParams
from plants.snake.equilibrium import MOST, ahead, slid
from plants.snake.friction import SnakeFrictionParams, flat_grip, grip_of
from plants.snake.parameters import STOP, SnakeParams
from plants.snake.posture import Array
from plants.snake.statics_kernels import (
    ROPES,
    Forces,
    Grip,
    assembled,
    empty_forces,
    loose,
)
from plants.snake.weight import GRAVITY
from systems.common.compiled import packed
from systems.common.parameter import check

RIGID = 1e3
"""Torsion of coupled balls, in Nm/rad: as good as none."""
RIM = 5.0
"""Of plates that meet at their rims, in Nm/rad."""


class Equilibrium(NamedTuple):
    """Where the snake stays, if it does.

    Attributes:
        turns: R_i of the six balls, (6, 3, 3).
        L: Lengths of the wires' paths in m, (9,).
        T: Tensions in N, (9,).
        H: Hessian of the energy in Nm/rad, (n, n) of the freedoms that there are.
        iterations: That it took.
        converged: Whether it is in balance.
        buckled: Whether the way there left a state that it could not stay in.
        heat: What friction took on the way, in J.
        P: Mean tension of each wire over each ball in N, (6, 9).
        grip: What it holds on to from here.
    """

    turns: Array
    L: Array
    T: Array
    H: Array
    iterations: int
    converged: bool
    buckled: bool
    heat: float
    P: Array
    grip: Grip

    @property
    def least_eigenvalue(self) -> float:
        """Of H: not positive where the snake is in balance and does not stay."""
        finite = np.isfinite(self.H).all()
        return float(np.linalg.eigvalsh(self.H)[0]) if finite else math.nan

    @property
    def stable(self) -> bool:
        """Whether the snake stays there."""
        return self.converged and self.least_eigenvalue > 0.0


class Statics:
    """A snake, its drive's masses and stiffness, and its core.

    Attributes:
        record: All of it, as the kernels take it: `record[0]`.
    """

    def __init__(
        self,
        params: SnakeParams | None = None,
        drive: SnakeDriveParams | None = None,
        core: SnakeCoreParams | None = None,
        gravity: ArrayLike = GRAVITY,
        friction: SnakeFrictionParams | None = None,
    ) -> None:
        """Makes it; `gravity` in W in m/s2, (3,)."""
        self.params = p = check(params or SnakeParams())
        self.drive = v = check(drive or SnakeDriveParams())
        self.core = c = check(core or SnakeCoreParams())
        self.friction = f = check(friction or SnakeFrictionParams())
        phi = np.ravel(p.azimuths())
        elastic = c.kind == "elastic"
        self.record = packed(
            R=p.ball_radius,
            d=p.face,
            e=p.plate_thickness,
            h=p.half_pitch,
            tool=p.tool_offset,
            points=p.ball_radius * np.column_stack([np.cos(phi), np.sin(phi)]),
            coupled=c.kind == "coupled",
            bend=c.bend if elastic else 0.0,
            twist=c.twist if elastic else RIGID if c.kind == "coupled" else 0.0,
            stop=p.max_bend + STOP,
            rim=RIM,
            ball=v.ball_mass,
            plate=v.plate_mass,
            ring=v.tool_mass,
            pretension=v.pretension,
            g=np.asarray(gravity, float),
            wire=f.wire,
            socket=f.socket,
            give=f.give,
        )

    def energy(
        self,
        turns: Array,
        tension: ArrayLike,
        wound: ArrayLike | None = None,
        force: ArrayLike = (0.0, 0.0, 0.0),
        moment: ArrayLike = (0.0, 0.0, 0.0),
    ) -> tuple[float, Forces]:
        """Energy in J and its derivatives, under tensions or lengths.

        Args:
            turns: R_i, (6, 3, 3).
            tension: Of wires as long as `wound`, or of all that there are, in N, (9,).
            wound: L_d of the drums in m, (9,); None for wires under `tension`.
            force: On the tool in W, in N, (3,).
            moment: On the tool in W, in Nm, (3,); it has no energy.
        """
        to = empty_forces()
        args = self._arguments(tension, wound, force, moment)
        return assembled(turns, *args, self.record[0], loose(turns), to), to

    def at_rest(self, turns: Array) -> Grip:
        """What friction holds on to where nothing has slid, and nothing pulls."""
        to, grip = empty_forces(), loose(turns)
        args = self._arguments((0.0,) * ROPES, None, (0.0,) * 3, (0.0,) * 3)
        assembled(turns, *args, self.record[0], grip, to)
        return grip._replace(slip=-to.slip)

    def ahead(self, grip: Grip) -> Array:
        """Where the balls will be if they turn as in the last step, (6, 3, 3)."""
        turns: Array = ahead(flat_grip(grip))
        return turns

    def equilibrium(
        self,
        turns: Array,
        tension: ArrayLike = (0.0,) * ROPES,
        wound: ArrayLike | None = None,
        force: ArrayLike = (0.0, 0.0, 0.0),
        moment: ArrayLike = (0.0, 0.0, 0.0),
        grip: Grip | None = None,
    ) -> Equilibrium:
        """The equilibrium downhill from turns; arguments as of `energy`.

        With friction it is the end of a step in which wires and force change steadily,
        from where `grip` holds: that of the last step, or all at rest at `turns`.
        It is looked for from `turns`, of which `ahead` makes a good guess.
        """
        args = self._arguments(tension, wound, force, moment)
        grip = grip_of(flat_grip(grip or self.at_rest(turns)))
        now, to, H, count, done, buckled, heat = slid(
            turns, *args, self.record[0], grip, MOST
        )
        return Equilibrium(now, to.L, to.T, H, count, done, buckled, heat, to.P, grip)

    def _arguments(
        self, tension: Any, wound: Any, force: Any, moment: Any
    ) -> tuple[Any, float, Any, Any]:
        load = np.array([*force, *moment], float)
        stiffness = 0.0 if wound is None else self.drive.wire_stiffness
        wound = np.zeros(ROPES) if wound is None else np.asarray(wound, float)
        return np.asarray(tension, float), stiffness, wound, load
