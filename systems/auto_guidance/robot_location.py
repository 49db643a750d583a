"""Robot location: where the robot's own tool is (Figure 2, the feedback)."""

from collections.abc import Sequence
from typing import Any

from pydrake.common.value import Value
from pydrake.systems.framework import ValueProducer

from plants.arm.controller_plant import INSTRUMENT_TIP, make_controller_plant
from plants.arm.parameters import READY_POSTURE
from plants.instruments.instrument import InstrumentParams
from systems.common.block import Block


class RobotLocation(Block):
    """The pose of the robot's instrument, from the measured joints.

    The arm's own kinematics, evaluated when somebody asks.

    Port ``arm_state`` accepts the measured joint positions [rad] and velocities
    [rad/s] (14).

    Port ``fulcrum`` accepts G_R (3), the point the shaft pivots about, in W [m].

    Port ``robot_tool`` emits p_WG and the measured tip p_WP (6), in W [m].
    """

    def __init__(self, instrument: InstrumentParams | None = None) -> None:
        """Makes the block for an arm that carries an instrument."""
        super().__init__()
        self._plant = make_controller_plant(instrument=instrument)
        self._tip = self._plant.GetFrameByName(INSTRUMENT_TIP)
        self._state = self.vector_in("arm_state", [*READY_POSTURE, *[0.0] * 7])
        self._fulcrum = self.vector_in("fulcrum", [0.0, 0.0, 0.0])
        # The plant's context is a cache entry: no state hides in this block.
        self._kinematics = self.DeclareCacheEntry(
            "kinematics",
            ValueProducer(
                allocate=lambda: Value(self._plant.CreateDefaultContext()),
                calc=self._calc_kinematics,
            ),
            {self._state.ticket()},
        )
        self.vector_out(
            "robot_tool",
            6,
            self._calc_tool,
            {self._state.ticket(), self._fulcrum.ticket()},
        )

    def _calc_kinematics(self, context: Any, value: Any) -> None:
        self._plant.SetPositions(
            value.get_mutable_value(), self._state.Eval(context)[:7]
        )

    def _calc_tool(self, context: Any) -> Sequence[float]:
        plant_context = self._kinematics.Eval(context)
        X_WT = self._tip.CalcPoseInWorld(plant_context)
        return [*self._fulcrum.Eval(context), *X_WT.translation()]
