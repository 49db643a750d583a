"""The tube: a rigid, hollow instrument of 10 mm that carries a snake in its bore.

It hangs on the wrist's sensor as any instrument does. The snake's channel frame C
stands on its axis, `gap` beyond its end, where an organ's entry is to be.
"""

from dataclasses import dataclass
from typing import Any

from pydrake.geometry import Cylinder
from pydrake.math import RigidTransform
from pydrake.multibody.tree import FixedOffsetFrame

from plants.common.looks import DARK, STEEL, draw
from plants.instruments.instrument import (
    Instrument,
    InstrumentParams,
    add_instrument,
)
from systems.common.parameter import parameter

TUBE = [0.72, 0.74, 0.77, 0.35]


@dataclass
class TubeParams(InstrumentParams):
    """Dimensions and masses; the drives of ten wires sit in the mount."""

    diameter: float = parameter(0.010, "of the tube", "m", least=0.003, most=0.012)
    mount_mass: float = parameter(
        0.45, "of the mount with the drives", "kg", least=0.01, most=2
    )
    shaft_mass: float = parameter(0.06, "of the tube", "kg", least=0.005, most=0.5)
    gap: float = parameter(
        0.040, "from the tube's end to the entry, at work", "m", least=0.0, most=0.1
    )


def add_tube(plant: Any, frame: Any, params: TubeParams) -> Instrument:
    """Hangs the tube on a frame of the plant through the wrist sensor.

    Args:
        plant: A MultibodyPlant that is not yet finalized.
        frame: What carries the sensor; z along the tube.
        params: Dimensions and masses.

    Raises:
        ValueError: If a parameter cannot be.
    """
    return add_instrument(plant, frame, params, _draw)


def channel_frame(plant: Any, tube: Instrument, params: TubeParams) -> Any:
    """Adds the snake's channel frame C to a plant that is not yet finalized."""
    X_MC = RigidTransform([0.0, 0.0, params.length + params.gap])
    body = tube.shaft.body_frame()
    return plant.AddFrame(FixedOffsetFrame("channel", body, X_MC, tube.instance))


def _draw(plant: Any, body: Any, params: InstrumentParams) -> None:
    """Sensor disc, the drives' housing, and a tube that can be seen through."""
    mount, radius = params.mount_length, 0.5 * params.diameter
    for name, r, first, last, rgba in (
        ("sensor", 0.034, 0.0, 0.016, STEEL),
        ("drives", 0.030, 0.016, mount, DARK),
        ("tube", radius, mount, params.length - 0.05, STEEL),
        ("end", radius, params.length - 0.05, params.length, TUBE),
    ):
        X_MG = RigidTransform([0.0, 0.0, 0.5 * (first + last)])
        draw(plant, body, Cylinder(r, last - first), X_MG, name, rgba)
