"""Robot location: where the robot's own tool is (Figure 2, the feedback)."""

from typing import Any

import numpy as np

from plants.arm.controller_plant import INSTRUMENT_TIP, make_controller_plant
from plants.arm.parameters import READY_POSTURE
from plants.instruments.instrument import InstrumentParams
from systems.common.block import Block
from systems.common.compiled import compiled
from systems.common.geometry import xyz
from systems.common.serial_arm import read_arm, tip_position


@compiled
def _robot_tool(arm: np.ndarray, p_WG: np.ndarray, state: np.ndarray) -> np.ndarray:
    return np.array(xyz(p_WG, 0) + tip_position(arm[0], state))


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
        plant = make_controller_plant(instrument=instrument)
        self._arm = read_arm(plant, plant.GetFrameByName(INSTRUMENT_TIP))
        self._state = self.vector_in("arm_state", [*READY_POSTURE, *[0.0] * 7])
        self._fulcrum = self.vector_in("fulcrum", [0.0, 0.0, 0.0])
        self.vector_out(
            "robot_tool",
            6,
            self._calc_tool,
            {self._state.ticket(), self._fulcrum.ticket()},
        )

    def _calc_tool(self, context: Any) -> np.ndarray:
        state = self._state.Eval(context)
        return _robot_tool(self._arm, self._fulcrum.Eval(context), state)
