"""What counts as a failure: an expression over a run's figures, never `eval`.

    min_tool_clearance < 0        not reached and stops == 0
    wall > 5 or error != ""       abs(tip_error) >= 1e-3

Numbers, texts, true, false, none, names of figures, `len`, `abs`, arithmetic,
comparisons, `and`, `or`, `not`. A figure that is missing or none can be compared by
== and != alone: any other use of it is an error, and that is a failure, too.
"""

import ast
from collections.abc import Callable, Iterable, Mapping
import operator
from typing import Any

from diagrams.common.scenario import ScenarioError, nearest

_OPERATORS: dict[type, Callable[..., Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.USub: operator.neg,
    ast.Not: operator.not_,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
    ast.Is: operator.is_,
    ast.IsNot: operator.is_not,
}
_WORDS = {"true": True, "false": False, "none": None}
_FUNCTIONS: dict[str, Callable[[Any], Any]] = {"abs": abs, "len": len}
_LONGEST = 500


class Expression:
    """A parsed expression.

    Attributes:
        text: As it was written.
        names: Of the figures in it.
    """

    def __init__(self, text: str) -> None:
        """Parses a text.

        Raises:
            ScenarioError: If it is no such expression.
        """
        self.text = text
        self.names: set[str] = set()
        try:
            tree = ast.parse(text.strip()[:_LONGEST], mode="eval")
            self._value = self._compile(tree.body)
        except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
            reason = getattr(error, "msg", None) or error
            raise ScenarioError(
                f"fail={text!r}: {reason}; expected e.g. 'min_tool_clearance < 0'"
            ) from error

    def __call__(self, figures: Mapping[str, Any]) -> Any:
        """Its value for a run's figures.

        Raises:
            TypeError: If a figure that is none is calculated with.
        """
        return self._value(figures)

    def check(self, known: Iterable[str]) -> None:
        """Raises a ScenarioError for a figure that no run has."""
        known = set(known)
        for name in sorted(self.names - known - {"error"}):
            hint = nearest(name, known)
            raise ScenarioError(f"fail={self.text!r}: no figure {name!r}: {hint}")

    def _compile(self, node: ast.expr) -> Callable[[Mapping[str, Any]], Any]:
        match node:
            case ast.Constant(value=bool() | int() | float() | str() | None as value):
                return lambda figures: value
            case ast.Name(id=word) if word in _WORDS:
                return lambda figures: _WORDS[word]
            case ast.Name(id=name):
                self.names.add(name)
                return lambda figures: figures.get(name)
            case ast.UnaryOp(op=op, operand=operand) if type(op) in _OPERATORS:
                act, inner = _OPERATORS[type(op)], self._compile(operand)
                return lambda figures: act(inner(figures))
            case ast.BinOp(left=left, op=op, right=right) if type(op) in _OPERATORS:
                act, a, b = (
                    _OPERATORS[type(op)],
                    self._compile(left),
                    self._compile(right),
                )
                return lambda figures: act(a(figures), b(figures))
            case ast.BoolOp(op=op, values=values):
                parts = [self._compile(value) for value in values]
                some = all if isinstance(op, ast.And) else any
                return lambda figures: some(part(figures) for part in parts)
            case ast.Compare(left=left, ops=ops, comparators=others):
                acts = [_OPERATORS.get(type(op)) for op in ops]
                if None not in acts:
                    sides = [self._compile(side) for side in (left, *others)]
                    return lambda figures: _chain(acts, [s(figures) for s in sides])
            case ast.Call(func=ast.Name(id=name), args=[argument], keywords=[]):
                if name in _FUNCTIONS:
                    act, inner = _FUNCTIONS[name], self._compile(argument)
                    return lambda figures: act(inner(figures))
        raise ValueError(f"{ast.unparse(node)!r} is not allowed here")


def _chain(acts: list[Any], values: list[Any]) -> bool:
    pairs = zip(acts, values, values[1:], strict=False)
    return all(act(a, b) for act, a, b in pairs)


def failures(
    expressions: Iterable[Expression], figures: Mapping[str, Any]
) -> list[str]:
    """The expressions that hold of a run, and those that cannot be told."""
    found = ["error"] if figures.get("error") else []
    for expression in expressions:
        try:
            if expression(figures):
                found.append(expression.text)
        except (TypeError, ZeroDivisionError):
            missing = sorted(n for n in expression.names if figures.get(n) is None)
            found.append(f"{expression.text}: {', '.join(missing)} missing")
    return found
