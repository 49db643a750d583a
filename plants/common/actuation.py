"""Set-points for actuators that nobody drives."""

from typing import Any

from pydrake.multibody.tree import ModelInstanceIndex
from pydrake.systems.primitives import ConstantVectorSource


def hold_still(builder: Any, plant: Any, instance: ModelInstanceIndex) -> None:
    """Arms the PD actuators of a model instance, all set-points zero.

    Drake disarms PD actuators whose desired state is not connected.

    Args:
        builder: The diagram that owns the plant.
        plant: A finalized MultibodyPlant.
        instance: Nothing happens if it has no actuators.
    """
    port = plant.get_desired_state_input_port(instance)
    if port.size() == 0:
        return
    source = builder.AddNamedSystem(
        f"{plant.GetModelInstanceName(instance)}_still",
        ConstantVectorSource([0.0] * port.size()),
    )
    builder.Connect(source.get_output_port(), port)
