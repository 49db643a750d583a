"""Scenarios: what all of them have, where their files lie, how one is saved."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
import dataclasses
from dataclasses import dataclass
import difflib
from pathlib import Path
import shutil
from typing import Any

from pydrake.common.yaml import yaml_dump_typed

SCENARIO_FOLDERS = Path(__file__).parents[1]
"""Scenarios lie in `diagrams/*/scenarios/*.yaml`; a file's stem is its name."""


class ScenarioError(ValueError):
    """A scenario, or a value in it, cannot be run as it stands."""


@contextmanager
def refusals() -> Iterator[None]:
    """Makes a block's or a plant's refusal of a value a ScenarioError."""
    try:
        yield
    except ScenarioError:
        raise
    except ValueError as error:
        raise ScenarioError(str(error)) from error


@dataclass
class Scenario:
    """What every scenario has. A study's own dataclass adds its fields.

    A field with `metadata={"file": True}` names a file: relative names are
    taken from the scenario's folder, and a run keeps a copy beside its results.

    Attributes:
        system: The study that runs it, a key of `diagrams.studies.STUDIES`.
        description: One line for `trocar scenarios`.
        duration: Simulated time [s].
        seed: Seed of all randomness of the run.
    """

    system: str = ""
    description: str = ""
    duration: float = 10.0
    seed: int = 0


def nearest(word: str, choices: Iterable[str]) -> str:
    """Says which of the choices a misspelt word probably meant."""
    options = sorted(choices)
    close = difflib.get_close_matches(word, options, 1, 0.5)
    if close:
        return f"did you mean {close[0]!r}?"
    return f"choose from {', '.join(options)}"


def scenario_files() -> dict[str, Path]:
    """All scenarios that ship with the project: name to file."""
    files = SCENARIO_FOLDERS.glob("*/scenarios/*.yaml")
    return {path.stem: path for path in sorted(files)}


def find_scenario(name: str) -> Path:
    """The file of a scenario, given its name or a path to it.

    Raises:
        ScenarioError: If there is neither such a name nor such a file.
    """
    files = scenario_files()
    if name in files:
        return files[name]
    path = Path(name)
    if path.suffix in (".yaml", ".yml"):
        if path.is_file():
            return path
        raise ScenarioError(f"no scenario file {name!r}")
    raise ScenarioError(f"no scenario {name!r}: {nearest(name, files)}")


def save_scenario(scenario: Any, folder: Path) -> Path:
    """Writes `scenario.yaml`, and copies of the files it names, into a folder.

    Returns:
        The file; loading it repeats the run.
    """
    copy = dataclasses.replace(scenario)
    for field in dataclasses.fields(copy):
        name = getattr(copy, field.name)
        if field.metadata.get("file") and name:
            target = folder / Path(name).name
            if target.resolve() != Path(name).resolve():
                shutil.copyfile(name, target)
            setattr(copy, field.name, target.name)
    path = folder / "scenario.yaml"
    path.write_text(yaml_dump_typed(copy))
    return path
