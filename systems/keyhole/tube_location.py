"""Tube location: where the tube is, from the measured joints, and will be in a period.

A snake that looks out of the tube makes up for the tube's motion; what it is told now
is done at the period's end. The joints are taken ahead at the speed that they have.
"""

from typing import Any

import numpy as np

from plants.arm.controller_plant import INSTRUMENT_TIP, make_controller_plant
from plants.arm.signals import ArmState
from plants.instruments.instrument import InstrumentParams
from systems.common.compiled import compiled, packed
from systems.common.serial_arm import read_arm, tip_frame
from systems.common.step_block import StepBlock
from systems.keyhole.signals import TubePose


@compiled
def _located(c: Any, arm: Any, state: ArmState) -> tuple[TubePose]:
    q, v = np.array(state.q), np.array(state.v)
    p, x, z = tip_frame(arm, q + c.lead * v)
    return (TubePose(p, x, z),)


class TubeLocation(StepBlock):
    """The pose of the tube's end.

    Port ``arm_state`` accepts the measured `ArmState`.

    Port ``tube`` emits the `TubePose`, ``lead`` ahead of time.
    """

    def __init__(self, tube: InstrumentParams | None = None, lead: float = 0.0) -> None:
        """Makes the block for an arm that carries a tube; lead in s."""
        super().__init__()
        plant = make_controller_plant(instrument=tube)
        self.declare_map(
            _located,
            [packed(lead=lead), read_arm(plant, plant.GetFrameByName(INSTRUMENT_TIP))],
            {"arm_state": ArmState},
            "tube",
            TubePose,
        )
