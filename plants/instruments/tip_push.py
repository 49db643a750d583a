"""A side force on the instrument's tip: tissue that it leans on, or another tool."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.common.value import Value
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import ExternallyAppliedSpatialForce

from systems.common.block import Block
from systems.common.parameter import check, parameter


@dataclass
class TipPushParams:
    """When the tip is pushed, and how."""

    force: list[float] = parameter(
        [0.0, 0.0, 0.0], "on the tip, in W", "N", least=-20, most=20, shape=(3,)
    )
    start: float = parameter(0.0, "when it begins", "s", least=0, most=1e5)
    duration: float = parameter(1e4, "how long it lasts", "s", least=0, most=1e5)
    # As long as a finger needs to press; 0 is at once.
    rise: float = parameter(0.05, "in which it comes and goes", "s", least=0, most=10)
    period: float = parameter(1 / 120, "of its changes", "s", above=0, most=0.1)

    def at(self, time: float) -> np.ndarray:
        """The force at a time in s, in N (3)."""
        since = time - self.start
        left = self.start + self.duration - time
        share = min(since, left) / self.rise if self.rise else float(min(since, left))
        if not self.rise:
            share = 1.0 if since >= 0.0 < left else 0.0
        return min(max(share, 0.0), 1.0) * np.array(self.force)


class TipPush(Block):
    """Pushes a body's point; held between its instants, so no Python is in a step.

    Port ``applied_spatial_force`` emits what the plant takes.
    """

    def __init__(self, params: TipPushParams, body: Any, p_BT: Any) -> None:
        """Makes the block for a body and a point of it, in its frame [m]."""
        super().__init__()
        self._params, self._body, self._point = check(params), body.index(), p_BT
        held = self.DeclareAbstractState(Value([self._push(0.0)]))
        self.DeclareStateOutputPort("applied_spatial_force", held)
        pushes = self.boxed(self._push)

        def update(context: Any, state: Any) -> None:
            held = state.get_mutable_abstract_state(0)
            held.set_value([pushes[0](context.get_time())])

        self.DeclarePeriodicUnrestrictedUpdateEvent(params.period, 0.0, update)

    def _push(self, time: float) -> ExternallyAppliedSpatialForce:
        push = ExternallyAppliedSpatialForce()
        push.body_index, push.p_BoBq_B = self._body, self._point
        push.F_Bq_W = SpatialForce(np.zeros(3), self._params.at(time))
        return push


def add_tip_push(
    builder: Any, plant: Any, instrument: Any, params: TipPushParams
) -> TipPush | None:
    """Adds the block as `tip_push` and wires it to the plant; None if it never pushes.

    Args:
        builder: The diagram's builder.
        plant: The finalized plant.
        instrument: What `add_instrument` returned.
        params: When and how.
    """
    if not any(params.force):
        return None
    point = [0.0, 0.0, instrument.length]
    block: TipPush = builder.AddNamedSystem(
        "tip_push", TipPush(params, instrument.shaft, point)
    )
    builder.Connect(
        block.get_output_port(), plant.get_applied_spatial_force_input_port()
    )
    return block
