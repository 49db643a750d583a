"""What organs do to the robot's tool: nothing, until it presses into one.

Tissue is compliant: at the deepest place of shaft and gauze the organ pushes along its
normal with F = k depth + c d(depth)/dt, never pulling and without friction. The force
is held between two instants, so no Python runs inside an integrator's step.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

import numpy as np
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import ExternallyAppliedSpatialForce
from pydrake.multibody.tree import BodyIndex

from plants.instruments.clearance import Capsule
from plants.instruments.instrument import GAUZE_RADIUS
from plants.organs.distance import Organs, distance, normal, shaft_distance
from plants.organs.organs import Organ, OrganSet, port
from systems.common.block import Block
from systems.common.compiled import compiled
from systems.common.geometry import along, scaled, sub
from systems.common.parameter import check, parameter
from systems.common.signal import Field, Many, Vector

_NEAR = 0.02
"""Farther from an organ it is not looked closely, m."""
_FASTEST = 0.2
"""Tool and organ never approach each other faster, m/s."""


class OrganGap(NamedTuple):
    """From the robot's shaft and gauze to an organ's surface."""

    distance: Annotated[float, Field("m", "negative for a penetration", 0.02, ("",))]


class Touch(NamedTuple):
    """What the organs do to the robot's tool."""

    f: Annotated[Vector, Field("N", "force on the tool", (0.0, 0.0, 0.0))]
    p: Annotated[Vector, Field("m", "where it acts, p_W", (0.0, 0.0, -0.1))]
    depth: Annotated[float, Field("m", "of the tool in the tissue", 0.0)]


@dataclass
class OrganTouchParams:
    """How touch is computed."""

    period: float = parameter(1 / 60, "of the force", "s", above=0.0, most=0.1)
    # A wire to the plant's applied forces costs a quarter of a run's time, even where
    # they are nothing.
    acts: bool = parameter(
        True, "whether tissue pushes back; else, if kept clear of, a touch ends the run"
    )


@compiled
def gaps(organs: Organs, a: Vector, b: Vector, radius: float) -> np.ndarray:
    """Of each organ (n, 3): gap to the shaft, where along it, gap to the gauze.

    Args:
        organs: The organs.
        a: The shaft's upper end, m.
        b: Its tip, m.
        radius: Of the shaft, m.
    """
    found = np.empty((len(organs.table), 3))
    for k in range(len(found)):
        d, s = shaft_distance(organs, k, a, b, _NEAR)
        found[k, 0], found[k, 1] = d - radius, s
        found[k, 2] = distance(organs, k, b) - GAUZE_RADIUS
    return found


@compiled
def placed(R: np.ndarray, p: np.ndarray, z: float) -> Vector:
    """A point of a body's z axis in W."""
    return p[0] + R[0, 2] * z, p[1] + R[1, 2] * z, p[2] + R[2, 2] * z


@compiled
def true_gaps(
    values: np.ndarray,
    table: np.ndarray,
    moved: np.ndarray,
    rod: np.ndarray,
    R: np.ndarray,
    p: np.ndarray,
) -> np.ndarray:
    """`OrganGap` of each organ; for the arguments see `touch`."""
    organs = Organs(values, table, moved.reshape(-1, 6))
    a, b = placed(R, p, rod[0]), placed(R, p, rod[1])
    found = gaps(organs, a, b, rod[2])
    least = np.empty(len(found))
    for k in range(len(found)):
        least[k] = min(found[k, 0], found[k, 2])
    return least


@compiled
def touch(
    values: np.ndarray,
    table: np.ndarray,
    moved: np.ndarray,
    rod: np.ndarray,
    R: np.ndarray,
    p: np.ndarray,
    tissue: np.ndarray,
    depths: np.ndarray,
    dt: float,
) -> np.ndarray:
    """What the organs do to the tool.

    Args:
        values: See `Organs`.
        table: See there.
        moved: See there, flat.
        rod: Where the shaft begins and ends along z of its body B, its radius, m (3).
        R: Orientation of B in W.
        p: Position of B in W, m.
        tissue: Stiffness in N/m and damping in N s/m of each organ (n, 2).
        depths: In all organs, an instant before (n), m.
        dt: How long ago that was, s; 0 for never.

    Returns:
        `Touch`, the depths, where along z of B it is, m, and the least gap: (n + 9).
    """
    organs = Organs(values, table, moved.reshape(-1, 6))
    a, b = placed(R, p, rod[0]), placed(R, p, rod[1])
    found, out, most = gaps(organs, a, b, rod[2]), np.zeros(9 + len(depths)), 0.0
    last, near = 7 + len(depths), 1e9
    out[3], out[4], out[5] = b
    for k in range(len(found)):
        gap = min(found[k, 0], found[k, 2])
        near = min(near, gap)
        depth = out[7 + k] = max(0.0, -gap)
        if depth <= 0.0:
            continue
        s = 1.0 if found[k, 2] <= found[k, 0] else found[k, 1]
        at = along(a, s, sub(b, a))
        rate = (depth - depths[k]) / dt if dt > 0.0 else 0.0
        f = max(0.0, tissue[k, 0] * depth + tissue[k, 1] * rate)
        if f > most:
            most = f
            push = scaled(f, normal(organs, k, at))
            for i in range(3):
                out[i], out[3 + i] = push[i], at[i]
            out[6], out[last] = depth, rod[0] + s * (rod[1] - rod[0])
    out[last + 1] = near
    return out


class OrganTouch(Block):
    """The organs' force on the robot's tool, and the true gaps to them.

    Port ``body_poses`` accepts the plant's `body_poses`.
    Port ``organs`` accepts the `MovingPoint` of each organ.
    Port ``touch`` emits the `Touch` of the last instant.
    Port ``applied`` emits it for the plant's port `applied_spatial_force`.
    Port ``gaps`` emits the `OrganGap` of each organ, for figures and tests only.
    """

    def __init__(
        self,
        organs: OrganSet,
        tissue: Sequence[Organ],
        robot: Capsule,
        params: OrganTouchParams | None = None,
    ) -> None:
        """Makes the block.

        Args:
            organs: The organs.
            tissue: The same, with their stiffness.
            robot: The robot's shaft, on a body of the plant.
            params: Parameters; the defaults if None.
        """
        super().__init__()
        params = params or OrganTouchParams()
        check(params)
        self._body, self._period = BodyIndex(robot.frame), params.period
        self._acts = params.acts
        low, high = sorted(robot.ends[:, 2].tolist())
        # The capsule's surface ends at the tip.
        shape = np.array([low, high + robot.radius, robot.radius])
        self._constants = (organs.values[0], organs.table[0])
        self._shape = shape
        self._tissue = np.array([[o.stiffness, o.damping] for o in tissue])
        self._bodies = self.DeclareAbstractInputPort(
            "body_poses", Value([RigidTransform()])
        )
        self._moved = self.signal_in("organs", port(organs)["organs"])
        count = len(organs.names)
        self.state_out("touch", Touch, np.zeros(7))
        self._depths = self.DeclareDiscreteState(np.zeros(count))
        self._held = self.DeclareDiscreteState(
            np.zeros(5)
        )  # where along z of B, force, when next
        self.value_out(
            "applied",
            lambda: Value([ExternallyAppliedSpatialForce()]),
            self._calc_applied,
            {self.xd_ticket()},  # no Python within an integrator's step
        )
        self.signal_out(
            "gaps",
            Many(OrganGap, organs.names),
            self._calc_gaps,
            {self._bodies.ticket(), self._moved.ticket()},
        )
        self.update_every(params.period, self._next)

    def _tool(self, context: Any) -> tuple[Any, ...]:
        """How the organs have moved, and the robot's shaft and its pose."""
        X_WB = self._bodies.Eval(context)[int(self._body)]
        moved = self._moved.Eval(context)
        return moved, self._shape, X_WB.rotation().matrix(), X_WB.translation()

    def _next(self, context: Any) -> list[np.ndarray]:
        state, time = context.get_discrete_state, context.get_time()
        held, before = state(self._held).value(), state(self._depths).value()
        if time < held[4]:  # what is far cannot be here yet
            return [state(0).value(), before, held]
        tool = self._tool(context)
        dt = self._period if time > 0.0 else 0.0
        told = (*self._constants, *tool, self._tissue, before, dt)
        out = touch(*told)
        if out[6] > 0.0 and not self._acts:
            raise RuntimeError(
                f"the tool touches an organ at {time:.3f} s, {1e3 * out[6]:.2f} mm "
                "deep; expected none with organ_touch.acts=false: set it to true"
            )
        next_look = time + out[-1] / _FASTEST
        return [out[:7], out[7:-2], np.array([out[-2], *out[:3], next_look])]

    def _calc_applied(self, context: Any, output: Any) -> None:
        held = context.get_discrete_state(self._held).value()
        if not held[1:4].any():
            output.set_value([])
            return
        one = ExternallyAppliedSpatialForce()
        one.body_index, one.p_BoBq_B = self._body, [0.0, 0.0, held[0]]
        one.F_Bq_W = SpatialForce(np.zeros(3), held[1:4])
        output.set_value([one])

    def _calc_gaps(self, context: Any) -> np.ndarray:
        return true_gaps(*self._constants, *self._tool(context))
