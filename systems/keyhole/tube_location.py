"""Tube location: where the tube is, and will be a period later.

A snake that looks out of the tube makes up for the tube's motion; what it is told now
is done at the period's end. The joints go on by what they are told, and lag it by as
much as now.
"""

from typing import Any

import numpy as np

from plants.arm.controller_plant import INSTRUMENT_TIP, make_controller_plant
from plants.arm.signals import ArmState, Posture
from plants.instruments.instrument import InstrumentParams
from systems.common.compiled import compiled
from systems.common.serial_arm import read_arm, tip_frame
from systems.common.step_block import StepBlock
from systems.keyhole.signals import TubePose


@compiled
def _located(
    arm: Any, state: ArmState, posture: Posture, following: Posture
) -> tuple[TubePose]:
    q = np.array(state.q) + np.array(following.q) - np.array(posture.q)
    p, x, z = tip_frame(arm, q)
    return (TubePose(p, x, z),)


class TubeLocation(StepBlock):
    """The pose of the tube's end a period later.

    Port ``arm_state`` accepts the measured `ArmState`.

    Port ``posture`` accepts the `Posture` that is commanded for now.

    Port ``next`` accepts that of the next instant.

    Port ``tube`` emits the `TubePose`.
    """

    def __init__(self, tube: InstrumentParams | None = None) -> None:
        """Makes the block for an arm that carries a tube."""
        super().__init__()
        plant = make_controller_plant(instrument=tube)
        self.declare_map(
            _located,
            [read_arm(plant, plant.GetFrameByName(INSTRUMENT_TIP))],
            {"arm_state": ArmState, "posture": Posture, "next": Posture},
            "tube",
            TubePose,
        )
