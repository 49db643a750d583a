"""A signal's fields have names: nobody reads one by a literal index."""

import ast
from pathlib import Path

from diagrams.studies import STUDIES, build, load_scenario
from systems.common.signal import columns, size

ROOT = Path(__file__).parents[1]
FILES = sorted(
    f for d in ("systems", "plants", "diagrams") for f in (ROOT / d).rglob("*.py")
)
DECLARING = {"signal_in", "signal_out", "state_out"}
MAPS = {"declare_step", "declare_update", "declare_map"}


type Nodes = list[ast.AST]
"""Of a file, walked once."""


def parsed(text: str) -> Nodes:
    """All nodes of a file's text."""
    return list(ast.walk(ast.parse(text)))


def ports(nodes: Nodes) -> set[str]:
    """Names of the ports that a file declares."""
    found = set()
    for node in nodes:
        if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute)):
            continue
        if node.func.attr in DECLARING and isinstance(node.args[0], ast.Constant):
            found.add(node.args[0].value)
        if node.func.attr in MAPS:
            keys = [k for a in node.args if isinstance(a, ast.Dict) for k in a.keys]
            found |= {k.value for k in keys if isinstance(k, ast.Constant)}
    return found


def annotated(nodes: Nodes, signals: set[str]) -> set[str]:
    """Names of the arguments that a file's functions take as signals."""
    arguments = [node for node in nodes if isinstance(node, ast.arg)]
    return {a.arg for a in arguments if getattr(a.annotation, "id", "") in signals}


def tuples(nodes: Nodes) -> set[str]:
    """Names of the signals that a file declares."""
    classes = [node for node in nodes if isinstance(node, ast.ClassDef)]
    return {
        c.name
        for c in classes
        if any(getattr(base, "id", "") == "NamedTuple" for base in c.bases)
    }


def is_literal(index: ast.expr) -> bool:
    """Whether an index, or a part of it, is a number written out."""
    if isinstance(index, ast.Slice):
        ends = [end for end in (index.lower, index.upper) if end is not None]
        return any(is_literal(end) for end in ends)
    if isinstance(index, ast.UnaryOp):
        return is_literal(index.operand)
    return isinstance(index, ast.Constant) and isinstance(index.value, int)


def literal_reads(nodes: Nodes, names: set[str]) -> list[str]:
    """Where a name is read by a literal index, or by `xyz` from one on."""
    found = []
    for node in nodes:
        if isinstance(node, ast.Subscript) and is_literal(node.slice):
            value = node.value
        elif (
            isinstance(node, ast.Call)
            and getattr(node.func, "id", "") == "xyz"
            and is_literal(node.args[1])
        ):
            value = node.args[0]
        else:
            continue
        if isinstance(value, ast.Name) and value.id in names:
            found.append(f"{node.lineno}: {ast.unparse(node)}")
    return found


def test_the_search_finds_what_it_looks_for():
    nodes = parsed(
        "self.signal_in('guide', Guide)\n"
        "a = guide[7] + guide[0:3] + xyz(guide, 9) + other[1] + guide[i]"
    )
    assert ports(nodes) == {"guide"}
    assert len(literal_reads(nodes, {"guide"})) == 3


def test_no_signal_is_read_by_a_literal_index():
    read = {file: parsed(file.read_text()) for file in FILES}
    signals = set().union(*map(tuples, read.values()))
    assert len(signals) > 40
    found = {}
    for file, nodes in read.items():
        reads = literal_reads(nodes, ports(nodes) | annotated(nodes, signals))
        if reads:
            found[str(file.relative_to(ROOT))] = reads
    assert not found
    assert not [f for f in FILES if "run.matrix(" in f.read_text()]


def test_what_is_logged_is_what_the_ports_emit():
    for name in ("gauze_static", "pwe_arc", "nav_one_static", "snake_circle"):
        scenario = load_scenario(name)
        diagram = build(scenario)
        logged = STUDIES[scenario.system].signals(scenario)
        assert len(logged) >= 4
        for port, signal in logged.items():
            assert diagram.GetOutputPort(port).size() == size(signal), port
            assert len(set(columns(signal))) == size(signal), port
