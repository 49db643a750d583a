"""Scenarios: what all of them have, and where their files lie."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
import difflib
from pathlib import Path

from plants.faults.fault import Fault
from systems.common.parameter import parameter

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


@contextmanager
def extra(name: str) -> Iterator[None]:
    """What is imported in this context may need an extra that is not installed."""
    try:
        yield
    except ModuleNotFoundError as error:
        raise ScenarioError(
            f"no module {error.name!r}: this needs the extra {name}, "
            f"pip install 'trocar[{name}]'"
        ) from error


@dataclass
class Scenario:
    """What every scenario has. A study's own dataclass adds its fields.

    Fields are declared as parameters (`systems.common.parameter`).
    """

    system: str = parameter("", "the study that runs it")
    description: str = parameter("", "one line for `trocar scenarios`")
    duration: float = parameter(10.0, "simulated time", "s", above=0.0, most=1e5)
    seed: int = parameter(0, "of all randomness of the run", least=0, most=2**63 - 1)
    faults: list[Fault] = parameter([], "what fails, and when", shape=(-1,))


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
