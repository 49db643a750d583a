"""Scenarios: dataclasses loaded from YAML, checked before anything runs."""

from collections.abc import Iterable, Sequence
import dataclasses
from dataclasses import dataclass
import difflib
import math
from pathlib import Path
import shutil
import types
import typing
from typing import Any

from pydrake.common.yaml import (
    yaml_dump,
    yaml_dump_typed,
    yaml_load,
    yaml_load_typed,
)

SCENARIO_FOLDERS = Path(__file__).parents[1]
"""Scenarios lie in `diagrams/*/scenarios/*.yaml`; a file's stem is its name."""


class ScenarioError(ValueError):
    """A scenario, or a value in it, cannot be run as it stands."""


@dataclass
class Scenario:
    """What every scenario has. A study's own dataclass adds its fields.

    A field with `metadata={"file": True}` names a file: relative names are
    taken from the scenario's folder, and a run keeps a copy beside its results.

    Attributes:
        system: The study that runs it, a key of `diagrams.common.study.STUDIES`.
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


def read_tree(path: Path) -> dict[str, Any]:
    """Reads a scenario's file as plain data.

    Raises:
        ScenarioError: If it is unreadable or not a map of keys to values.
    """
    try:
        tree = yaml_load(filename=str(path))
    except Exception as error:  # the YAML parser's own error types are private
        raise ScenarioError(f"cannot read {path}: {error}") from error
    if not isinstance(tree, dict):
        raise ScenarioError(f"{path} holds no keys; expected e.g. 'system: gauze'")
    return tree


def apply_override(tree: dict[str, Any], text: str) -> str:
    """Puts `KEY.SUB=VALUE` into the tree; the value is read as YAML.

    Returns:
        The first part of the key.

    Raises:
        ScenarioError: If the text has no such form.
    """
    key, equals, value = text.partition("=")
    parts = key.strip().split(".")
    if not equals or not all(parts):
        raise ScenarioError(f"--set {text!r}: expected KEY.SUB=VALUE")
    try:
        parsed = yaml_load(data=f"value: {value}")["value"]
    except Exception as error:
        raise ScenarioError(f"--set {text!r}: {value!r} is no value") from error
    node = tree
    for part in parts[:-1]:
        child = node.setdefault(part, {})
        if not isinstance(child, dict):
            raise ScenarioError(f"--set {text!r}: {part!r} has no keys below it")
        node = child
    node[parts[-1]] = parsed
    return parts[0]


def check_tree(schema: Any, value: Any, path: str = "") -> None:
    """Holds plain data against a dataclass: keys, types, shapes, finiteness.

    Args:
        schema: A dataclass or a field's type (float, int, bool, str, list[...],
            dict[str, ...], or one of these `| None`).
        value: What was read.
        path: The key that leads here, for the message.

    Raises:
        ScenarioError: With the key, the value, what was expected and, for an
            unknown key, the nearest valid one.
    """

    def refuse(expected: str) -> typing.NoReturn:
        raise ScenarioError(f"{path}={value!r}: expected {expected}")

    origin = typing.get_origin(schema)
    if isinstance(schema, types.UnionType) or origin is typing.Union:
        members = [m for m in typing.get_args(schema) if m is not type(None)]
        if value is not None:
            check_tree(members[0], value, path)
    elif dataclasses.is_dataclass(schema):
        if not isinstance(value, dict):
            refuse("keys and values")
        fields = typing.get_type_hints(schema)
        for key, item in value.items():
            name = f"{path}.{key}" if path else str(key)
            if key not in fields:
                raise ScenarioError(f"unknown key {name!r}: {nearest(key, fields)}")
            check_tree(fields[key], item, name)
    elif origin is list:
        if not isinstance(value, list):
            refuse("a list, e.g. [0.0, 0.0, 0.1]")
        for index, item in enumerate(value):
            check_tree(typing.get_args(schema)[0], item, f"{path}[{index}]")
    elif origin is dict:
        if not isinstance(value, dict):
            refuse("keys and values")
        for key, item in value.items():
            check_tree(typing.get_args(schema)[1], item, f"{path}.{key}")
    elif schema is float:
        if isinstance(value, bool) or not isinstance(value, int | float):
            refuse("a number")
        if not math.isfinite(value):
            refuse("a finite number")
    elif schema in (int, bool, str) and type(value) is not schema:
        names = {int: "a whole number", bool: "true or false", str: "a text"}
        refuse(names[schema])


def load_scenario(
    name: str,
    overrides: Sequence[str] = (),
    seed: int | None = None,
    duration: float | None = None,
) -> Any:
    """Loads a scenario by name or file, with overrides, and checks it.

    Args:
        name: A scenario's name (see `scenario_files`) or the path of a file.
        overrides: `KEY.SUB=VALUE` texts, applied in order.
        seed: Replaces the scenario's seed.
        duration: Replaces the scenario's duration [s].

    Returns:
        The study's own scenario dataclass.

    Raises:
        ScenarioError: For anything that can be known to be wrong beforehand.
    """
    from diagrams.common.study import get_study

    path = find_scenario(name)
    tree = read_tree(path)
    if "system" not in tree:
        raise ScenarioError(f"{path}: missing key 'system', e.g. 'system: gauze'")
    study = get_study(tree["system"])
    schema = study.scenario
    files = [f.name for f in dataclasses.fields(schema) if f.metadata.get("file")]
    folders = dict.fromkeys(files, path.parent)
    for text in overrides:
        folders[apply_override(tree, text)] = Path.cwd()
    if seed is not None:
        tree["seed"] = seed
    if duration is not None:
        tree["duration"] = duration
    for key, value in tree.items():
        # YAML reads a plain `off` as false; where a text is wanted it is one.
        if value is False and typing.get_type_hints(schema).get(key) is str:
            tree[key] = "off"
    for key in study.required:
        require(tree, key, path)
    check_tree(schema, tree)
    scenario = yaml_load_typed(schema=schema, data=yaml_dump(tree))
    for key in files:
        if getattr(scenario, key):
            setattr(scenario, key, str(folders[key] / getattr(scenario, key)))
    check_scenario(scenario)
    return scenario


def require(tree: dict[str, Any], key: str, path: Path) -> None:
    """Raises a ScenarioError unless the dotted key stands in the tree."""
    node: Any = tree
    for part in key.split("."):
        if not isinstance(node, dict) or part not in node:
            raise ScenarioError(f"{path}: missing key {key!r}")
        node = node[part]


def check_scenario(scenario: Any) -> None:
    """Runs the common and the study's own checks; raises ScenarioError."""
    from diagrams.common.study import get_study

    if not scenario.duration > 0.0:
        raise ScenarioError(f"duration={scenario.duration} s: expected > 0")
    if scenario.seed < 0:
        raise ScenarioError(f"seed={scenario.seed}: expected >= 0")
    try:
        get_study(scenario.system).check(scenario)
    except ScenarioError:
        raise
    except ValueError as error:  # a block's or plant's own parameter check
        raise ScenarioError(str(error)) from error


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
