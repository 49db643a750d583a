"""Plain data from YAML as people write it, held against a dataclass."""

import dataclasses
import math
from pathlib import Path
import re
import types
import typing
from typing import Any

import yaml

from diagrams.common.scenario import ScenarioError, nearest
from systems.common.archive import read_regular
from systems.common.parameter import default_of

BOOL = "tag:yaml.org,2002:bool"
NAMED = "tools"
"""The list whose items are called by their names."""
SWITCHES = {"yes": True, "on": True, "no": False, "off": False}
"""Texts that are true or false where that is wanted, and only there."""


MOST_VALUES = 100_000
"""Of one text in YAML, with every alias written out."""

LARGEST_FILE = 1_000_000
"""Of a scenario, in bytes."""


def _weight(node: Any, known: dict[int, float]) -> float:
    """Number of values in a node with every alias written out."""
    if id(node) not in known:
        known[id(node)] = math.inf  # where it is within itself
        parts = [] if isinstance(node, yaml.ScalarNode) else node.value
        if isinstance(node, yaml.MappingNode):
            parts = [part for pair in parts for part in pair]
        known[id(node)] = 1 + sum(_weight(part, known) for part in parts)
    return known[id(node)]


class _Reader(yaml.SafeLoader):
    """Reads YAML: no key twice, and of plain words only true and false are no text."""

    def get_single_node(self) -> Any:
        node = super().get_single_node()
        if node is not None and _weight(node, {}) > MOST_VALUES:
            raise yaml.YAMLError(
                f"expected at most {MOST_VALUES} values, every alias written out"
            )
        return node

    yaml_implicit_resolvers = {
        first: [(tag, pattern) for tag, pattern in kinds if tag != BOOL]
        for first, kinds in yaml.SafeLoader.yaml_implicit_resolvers.items()
    }

    def compose_mapping_node(self, anchor: Any) -> Any:
        node = super().compose_mapping_node(anchor)
        keys: set[Any] = set()
        for key, _ in node.value:
            if isinstance(key, yaml.ScalarNode):
                if key.value in keys:
                    raise yaml.constructor.ConstructorError(
                        problem=f"key {key.value!r} stands twice",
                        problem_mark=key.start_mark,
                    )
                keys.add(key.value)
        return node


_Reader.add_implicit_resolver(
    BOOL, re.compile("^(true|True|TRUE|false|False|FALSE)$"), list("tTfF")
)


def read_yaml(data: str | bytes, source: str) -> Any:
    """Reads YAML, with or without a byte order mark.

    Raises:
        ScenarioError: If it is none, or a key stands twice; names the source.
    """
    try:
        return yaml.load(data, Loader=_Reader)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line = f", line {mark.line + 1}" if mark else ""
        raise ScenarioError(f"{source}{line}: {error.problem}") from error
    except RecursionError as error:
        raise ScenarioError(f"{source}: lists or keys are nested too deep") from error
    except (yaml.YAMLError, ValueError) as error:  # no text, no such day, ...
        reason = " ".join(str(error).split())
        raise ScenarioError(f"{source}: {reason}") from error


def read_tree(path: Path) -> dict[str, Any]:
    """Reads a scenario's file as plain data, but for keys that begin with `_`.

    Raises:
        ScenarioError: If it is unreadable or not a map of keys to values.
    """
    try:
        data = read_regular(path, LARGEST_FILE)
    except OSError as error:
        raise ScenarioError(f"cannot read {path}: {error.strerror}") from error
    tree = read_yaml(data, f"cannot read {path}")
    if not isinstance(tree, dict):
        raise ScenarioError(f"{path} holds no keys; expected e.g. 'system: gauze'")
    return {key: value for key, value in tree.items() if str(key)[:1] != "_"}


def apply_override(tree: dict[str, Any], text: str) -> str:
    """Puts `KEY.SUB=VALUE` into the tree; the value is read as YAML. Tools are added.

    Returns:
        The first part of the key.

    Raises:
        ScenarioError: If the text has no such form.
    """
    key, equals, told = text.partition("=")
    parts = key.strip().split(".")
    if not equals or not all(parts):
        raise ScenarioError(f"--set {text!r}: expected KEY.SUB=VALUE")
    parsed = read_yaml(f"value: {told}", f"--set {text!r}: {told!r} is no value")
    return put(tree, parts, parsed["value"], f"--set {text!r}")


def put(tree: dict[str, Any], parts: list[str], value: Any, source: str) -> str:
    """Puts a value below a key's parts into the tree. Tools are added.

    Returns:
        The first part.

    Raises:
        ScenarioError: If a part has no keys below it; names the source.
    """
    node = tree
    for part in parts[:-1]:
        child = node.setdefault(part, {})
        if not isinstance(child, dict):
            raise ScenarioError(f"{source}: {part!r} has no keys below it")
        node = child
    before = node.get(parts[-1])
    both = parts == [NAMED] and isinstance(value, list) and isinstance(before, list)
    node[parts[-1]] = before + value if both else value
    return parts[0]


def require(tree: dict[str, Any], key: str, path: Path) -> None:
    """Raises a ScenarioError unless the dotted key stands in the tree."""
    node: Any = tree
    for part in key.split("."):
        named = {tool["name"]: tool for tool in tree.get(NAMED, ())}
        if node is tree and part not in node and part in named:
            node = named[part]
        elif isinstance(node, dict) and part in node:
            node = node[part]
        else:
            raise ScenarioError(f"{path}: missing key {key!r}")


def fit(schema: Any, value: Any, path: str = "") -> Any:
    """Holds plain data against a dataclass: keys, types, shapes, finiteness.

    Args:
        schema: A dataclass or a field's type (float, int, bool, str, list[...],
            dict[str, ...], or one of these `| None`).
        value: What was read.
        path: The key that leads here, for the message.

    Returns:
        The data. Where a number is wanted, a text such as `1e-3` has become one;
        where true or false is wanted, yes, no, on and off have.

    Raises:
        ScenarioError: With the key, the value, what was expected and, for an
            unknown key, the nearest valid one.
    """

    def refuse(expected: str) -> typing.NoReturn:
        raise ScenarioError(f"{path}={value!r}: expected {expected}")

    schema = getattr(schema, "__value__", schema)
    origin = typing.get_origin(schema)
    if isinstance(schema, types.UnionType) or origin is typing.Union:
        return None if value is None else fit(member(schema, value), value, path)
    if dataclasses.is_dataclass(schema):
        if not isinstance(value, dict):
            refuse("keys and values")
        fields = typing.get_type_hints(schema)
        fitted = {}
        for key, item in value.items():
            name = f"{path}.{key}" if path else str(key)
            if key not in fields:
                raise ScenarioError(
                    f"unknown key {name!r}: {nearest(str(key), fields)}"
                )
            fitted[key] = fit(fields[key], item, name)
        return fitted
    if origin is list:
        if not isinstance(value, list):
            refuse("a list, e.g. [0.0, 0.0, 0.1]")
        kind = typing.get_args(schema)[0]
        return [fit(kind, item, place(path, i, item)) for i, item in enumerate(value)]
    if origin is dict:
        if not isinstance(value, dict):
            refuse("keys and values")
        kind = typing.get_args(schema)[1]
        return {key: fit(kind, item, f"{path}.{key}") for key, item in value.items()}
    if schema is float:
        return _number(value, refuse)
    if schema is bool and isinstance(value, str):
        value = SWITCHES.get(value.lower(), value)
    if schema in (int, bool, str) and type(value) is not schema:
        names = {int: "a whole number", bool: "true or false", str: "a text"}
        refuse(names[schema])
    return value


def place(path: str, index: int, item: Any) -> str:
    """The key of a list's item; a tool is called by its name alone."""
    named = path == NAMED and isinstance(item, dict) and item.get("name")
    return str(named) if named else f"{path}[{index}]"


def member(schema: Any, value: Any) -> Any:
    """The one of several types that a value is of: by its `role`, or as it is.

    Raises:
        ScenarioError: If none has the role.
    """
    members = [m for m in typing.get_args(schema) if m is not type(None)]
    if len(members) == 1 or not isinstance(value, dict):
        return type(value) if type(value) in members else members[0]
    roles = {role: m for m in members for role in _roles(m)}
    role = value.get("role", next(iter(_roles(members[0])), ""))
    if role not in [*roles]:  # a list is no key
        raise ScenarioError(f"role={role!r}: {nearest(str(role), roles)}")
    return roles[role]


def _roles(schema: Any) -> tuple[str, ...]:
    told = {f.name: f.metadata for f in dataclasses.fields(schema)}
    choices: tuple[str, ...] = told["role"]["parameter"].choices
    return choices


def make(schema: Any, value: Any, default: Any = None) -> Any:
    """The dataclass of plain data that fit it.

    Args:
        schema: The dataclass.
        value: What is told of it.
        default: What it is where it is not told; the dataclass's own defaults if None.
    """
    schema = getattr(schema, "__value__", schema)
    origin = typing.get_origin(schema)
    if isinstance(schema, types.UnionType) or origin is typing.Union:
        kind = member(schema, value) if value is not None else None
        return None if value is None else make(kind, value, default)
    if dataclasses.is_dataclass(schema):
        kinds = typing.get_type_hints(schema)
        held = default if type(default) is schema else None
        own = {f.name: default_of(f) for f in dataclasses.fields(schema)}
        own |= vars(held) if held is not None else {}
        made = {key: make(kinds[key], item, own[key]) for key, item in value.items()}
        if held is not None:
            return dataclasses.replace(held, **made)
        return typing.cast(typing.Callable[..., Any], schema)(**made)
    if origin is list:
        return [make(typing.get_args(schema)[0], item) for item in value]
    if origin is dict:
        kind = typing.get_args(schema)[1]
        return {key: make(kind, item) for key, item in value.items()}
    return float(value) if schema is float else value


def settle(schema: Any, value: Any, folder: Path) -> None:
    """Makes the names of files in plain data absolute, taken from a folder."""
    schema = getattr(schema, "__value__", schema)
    if isinstance(schema, types.UnionType) and value is not None:
        schema = member(schema, value)
    if isinstance(value, list) and typing.get_origin(schema) is list:
        for item in value:
            settle(typing.get_args(schema)[0], item, folder)
    if not isinstance(value, dict) or not dataclasses.is_dataclass(schema):
        return
    kinds = typing.get_type_hints(schema)
    for field in dataclasses.fields(schema):
        item, told = value.get(field.name), field.metadata.get("parameter")
        if told and told.file and isinstance(item, str) and item:
            value[field.name] = str(folder / item)
        settle(kinds[field.name], item, folder)


def _number(value: Any, refuse: typing.Callable[[str], typing.NoReturn]) -> float | int:
    """A finite number, also from a text: to YAML 1.1, `1e-3` is one."""
    try:
        number = float(value) if isinstance(value, str) else value
        if isinstance(number, bool) or not isinstance(number, int | float):
            refuse("a number")
        is_finite = math.isfinite(number)
    except OverflowError:  # a whole number of hundreds of digits
        is_finite = False
    except ValueError:
        refuse("a number")
    if not is_finite:
        refuse("a finite number")
    return number
