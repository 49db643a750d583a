"""What a docstring says here and mkdocstrings does not see: ports, and parameters."""

import ast
from typing import Any

import griffe


def listed(text: str) -> str:
    """A docstring with its ports as a list.

    Args:
        text: In which each port begins a line, ``Port `tool` accepts ...``.
    """
    lines, in_port = [], False
    for line in text.splitlines():
        begins = line.startswith("Port ``")
        if begins and not in_port:
            lines.append("")
        in_port = begins or (in_port and bool(line.strip()))
        more = "- " if begins else "  " if in_port else ""
        lines.append(more + line.strip() if in_port else line)
    return "\n".join(lines)


def meaning(value: str) -> str:
    """What `parameter(default, meaning, unit, ...)` says, or "".

    Args:
        value: Of a field, as source.
    """
    call = ast.parse(value, mode="eval").body
    if not isinstance(call, ast.Call) or ast.unparse(call.func) != "parameter":
        return ""
    told = [str(a.value) for a in call.args[1:] if isinstance(a, ast.Constant)]
    return f"{told[0]} [{told[1]}]" if len(told) > 1 else "".join(told)


class House(griffe.Extension):
    """Makes lists of ports, and gives parameters their docstrings."""

    def on_class(self, *, cls: griffe.Class, **kwargs: Any) -> None:
        """Ports of a block."""
        if cls.docstring and "Port ``" in cls.docstring.value:
            cls.docstring.value = listed(cls.docstring.value)

    def on_attribute(self, *, attr: griffe.Attribute, **kwargs: Any) -> None:
        """A parameter of a dataclass."""
        if attr.docstring is None and attr.value is not None:
            said = meaning(str(attr.value))
            if said:
                attr.docstring = griffe.Docstring(said, parent=attr)
