"""How a plant's part finds the model file beside it."""

from pathlib import Path
from typing import Any

from pydrake.multibody.parsing import Parser
from pydrake.multibody.tree import ModelInstanceIndex


def add_model(plant: Any, folder: Path, file: str) -> ModelInstanceIndex:
    """Parses the one model in `folder`/`file` into a plant.

    Args:
        plant: A MultibodyPlant that is not yet finalized.
        folder: Holds the model and its `package.xml`.
        file: The model's file name.

    Returns:
        The new model instance; a second copy gets a prefix of its own.
    """
    parser = Parser(plant)
    parser.SetAutoRenaming(True)
    parser.package_map().AddPackageXml(str(folder / "package.xml"))
    (instance,) = parser.AddModels(str(folder / file))
    return instance
