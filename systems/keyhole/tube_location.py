"""Tube location: where the tube is, and will be a period later.

A snake that looks out of the tube makes up for the tube's motion; what it is told now
is done at the period's end. Until then the joints go on by what they are told, and what
they lag dies away as their servos have it.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from plants.arm.arm import ArmParams, servo_step
from plants.arm.controller_plant import INSTRUMENT_TIP, make_controller_plant
from plants.arm.parameters import READY_POSTURE
from plants.arm.signals import ArmState, Posture
from plants.instruments.instrument import InstrumentParams
from systems.common.compiled import compiled, packed
from systems.common.serial_arm import read_arm, tip_frame
from systems.common.step_block import StepBlock
from systems.keyhole.signals import TubePose


@compiled
def _located(
    arm: Any, c: Any, state: ArmState, posture: Posture, following: Posture
) -> tuple[TubePose]:
    q_d, q_next = np.array(posture.q), np.array(following.q)
    lag = np.array(state.q) - q_d
    ahead = c.period * np.array(state.v) - (q_next - q_d)
    for i in range(len(lag)):
        q_next[i] += (c.A[i] * lag).sum() + (c.C[i] * ahead).sum()
    p, x, z = tip_frame(arm, q_next)
    return (TubePose(p, x, z),)


class TubeLocation(StepBlock):
    """The pose of the tube's end a period later.

    Port ``arm_state`` accepts the measured `ArmState`.

    Port ``posture`` accepts the `Posture` that is commanded for now.

    Port ``next`` accepts that of the next instant.

    Port ``tube`` emits the `TubePose`.
    """

    def __init__(
        self,
        tube: InstrumentParams | None = None,
        posture: Sequence[float] = READY_POSTURE,
        arm: ArmParams | None = None,
        period: float = 1 / 120,
    ) -> None:
        """Makes the block.

        Args:
            tube: What the arm carries.
            posture: About which it works, in rad (7).
            arm: Its servos.
            period: Of their set-points in s.
        """
        super().__init__()
        plant = make_controller_plant(instrument=tube)
        A, C = servo_step(plant, posture, arm, period)
        self.declare_map(
            _located,
            [
                read_arm(plant, plant.GetFrameByName(INSTRUMENT_TIP)),
                packed(A=A, C=C, period=period),
            ],
            {"arm_state": ArmState, "posture": Posture, "next": Posture},
            "tube",
            TubePose,
        )
