"""Compiled functions: their parameters, and a cache that notices changes."""

from dataclasses import dataclass, field
import os
from pathlib import Path
import re
import shutil
import subprocess
import sys
import textwrap

import numba
import numpy as np
import pytest

from systems.common.compiled import InTree, UserWide, announced, compiled, packed


@dataclass
class Params:
    """A block's parameters."""

    form: str = "corrected"
    gain: float = 20.0
    on: bool = True
    centers: list[float] = field(default_factory=lambda: [0.0, 1.0])
    fulcrum: list[float] | None = None


@compiled
def weigh(record, x):
    params = record[0]
    return params.gain * x + params.centers[1] + params.table[1, 0]


def test_parameters_are_read_by_name():
    record = packed(Params(), table=np.arange(4).reshape(2, 2))
    assert record.dtype.names == ("gain", "on", "centers", "table")
    assert record.dtype["table"].base == np.dtype(int)
    assert weigh(record, 2.0) == 20.0 * 2.0 + 1.0 + 2.0


def test_whole_numbers_make_no_other_type():
    assert packed(Params(gain=20)).dtype == packed(Params(gain=20.0)).dtype


def test_division_by_zero_gives_infinity():
    @compiled
    def inverse(x):
        return 1.0 / x

    assert inverse(0.0) == np.inf


def test_what_only_compiled_functions_call_has_no_way_in_from_python():
    @compiled
    def double(x):
        return 2.0 * x

    @compiled
    def quadruple(x):
        return double(double(x))

    assert quadruple(1.0) == 4.0
    assert double.inner.signatures and not double.signatures
    assert double(3.0) == 6.0
    assert double.signatures == double.inner.signatures


def test_what_python_has_called_is_not_compiled_again_for_others(monkeypatch):
    @compiled
    def double(x):
        return 2.0 * x

    @compiled
    def quadruple(x):
        return double(double(x))

    assert double(3.0) == 6.0
    with monkeypatch.context() as patched:
        patched.setattr(double.inner._compiler, "compile", None)
        assert quadruple(1.0) == 4.0
    assert list(double.inner.overloads.values()) == list(double.overloads.values())


def test_a_constant_in_a_call_is_a_number_like_others():
    @compiled
    def scaled(x, n, whole):
        return x * n if whole else x

    @compiled
    def call(x, n):
        return scaled(x, 3, True) + scaled(x, n, False) + scaled(x, 4, n > 1)

    assert call(2.0, 5) == 16.0
    assert len(scaled.inner.signatures) == 1


def test_where_nothing_can_be_written_it_is_compiled_all_the_same(monkeypatch):
    def refuse(locator):
        raise OSError("read-only")

    for place in (InTree, UserWide):
        monkeypatch.setattr(place, "ensure_cache_path", refuse)

    @compiled
    def thrice(x):
        return 3.0 * x

    assert thrice(2.0) == 6.0


def test_a_function_of_no_file_is_compiled_too():
    scope = {"compiled": compiled}
    source = "@compiled\ndef twice(x):\n    return 2.0 * x"
    exec(compile(source, "<a notebook's cell>", "exec"), scope)
    assert scope["twice"](2.0) == 4.0


def test_compilation_is_announced_once_at_a_terminal(capsys, monkeypatch):
    @numba.njit
    def one(x):
        return x + 1.0

    @numba.njit
    def two(x):
        return one(x) + 1.0

    monkeypatch.setattr("sys.stderr.isatty", lambda: True)
    with announced():
        two(1.0)
    assert capsys.readouterr().err.count("compiling") == 1
    with announced():
        two(1.0)
    assert not capsys.readouterr().err


ROOT = Path(__file__).parents[3]

PACKAGES = {
    "ground/vectors.py": """
        @compiled
        def twice(x):
            return 2.0 * x
        """,
    "ground/sizes.py": """
        from typing import NamedTuple

        GAIN = 10.0

        class Ball(NamedTuple):
            radius: float
            width: float
        """,
    "ground/rates.py": """
        from ground.sizes import GAIN

        RATE = GAIN * 10.0
        """,
    "world/kernels.py": """
        from ground import vectors

        OTHER = 7.0

        @compiled
        def fourfold(x):
            return vectors.twice(vectors.twice(x))
        """,
    "control/block.py": """
        from ground import vectors
        from ground.rates import RATE
        from ground.sizes import GAIN, Ball
        from ground.vectors import twice
        from world.kernels import fourfold

        @compiled
        def by_name(x):
            return twice(x) + 1.0

        @compiled
        def by_module(x):
            return vectors.twice(x) + 2.0

        @compiled
        def by_constant(x):
            return GAIN * x

        @compiled
        def by_derived_constant(x):
            return RATE * x

        def width(ball: Ball, x):
            return ball.width * x

        by_type = compiled(width)

        @compiled
        def two_files_away(x):
            return fourfold(x) + 3.0

        exec(compile("def made(x):\\n return GAIN + x", __file__, "exec"))
        by_exec = compiled(made)

        exec(compile("def made(x):\\n return RATE + x", __file__, "exec"))
        like_by_exec = compiled(made)

        def generated(step):
            scope = {"step": step, "__name__": __name__}
            exec(compile("def made(x):\\n return step(x)", __file__, "exec"), scope)
            return compiled(scope["made"])

        given, like_given = generated(fourfold), generated(twice)

        @compiled
        def alone(x, more=0.5):
            return x + more

        if __name__ == "__main__":
            for name in (
                "by_name by_module by_constant by_derived_constant two_files_away "
                "by_exec like_by_exec given like_given alone"
            ).split():
                f = globals()[name]
                print(name, f(1.0), len(f.stats.cache_hits))
            f = by_type
            print("by_type", f(Ball(3.0, 5.0), 1.0), len(f.stats.cache_hits))
        """,
}

RESULTS = {
    "by_name": 3.0,
    "by_module": 4.0,
    "by_constant": 10.0,
    "by_derived_constant": 100.0,
    "two_files_away": 7.0,
    "by_exec": 11.0,
    "like_by_exec": 101.0,
    "given": 4.0,
    "like_given": 2.0,
    "alone": 1.5,
    "by_type": 5.0,
}

EDITS = [
    (
        "ground/vectors.py",
        ("2.0 * x", "3.0 * x"),
        {
            "by_name": 4.0,
            "by_module": 5.0,
            "two_files_away": 12.0,
            "given": 9.0,
            "like_given": 3.0,
        },
    ),
    (
        "ground/sizes.py",
        ("GAIN = 10.0", "GAIN = 20.0"),
        {
            "by_constant": 20.0,
            "by_derived_constant": 200.0,
            "by_exec": 21.0,
            "like_by_exec": 201.0,
            "by_type": 5.0,
        },
    ),
    (
        "ground/sizes.py",
        ("radius: float\n    width: float", "width: float\n    radius: float"),
        {
            "by_constant": 20.0,
            "by_derived_constant": 200.0,
            "by_exec": 21.0,
            "like_by_exec": 201.0,
            "by_type": 3.0,
        },
    ),
    (
        "world/kernels.py",
        ("OTHER = 7.0", "OTHER = 8.0"),
        {"two_files_away": 12.0, "given": 9.0},
    ),
]


def python(folder: Path, *program: str) -> str:
    """What a program prints in a process of its own, without Python's own caches."""
    path = os.pathsep.join([str(folder), str(ROOT)])
    return subprocess.run(
        [sys.executable, "-B", *program],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": path},
        check=True,
        capture_output=True,
        text=True,
    ).stdout


def write_packages(folder: Path) -> None:
    """Writes `PACKAGES`."""
    for name, source in PACKAGES.items():
        file = folder / name
        file.parent.mkdir(exist_ok=True)
        (file.parent / "__init__.py").touch()
        decorator = "from systems.common.compiled import compiled\n"
        file.write_text(decorator + textwrap.dedent(source))


def test_what_was_loaded_before_a_change_is_not_taken_for_what_it_became(tmp_path):
    write_packages(tmp_path)
    edit = (
        "from pathlib import Path\n"
        "from control.block import two_files_away as f\n"
        "file = Path('ground/vectors.py')\n"
        "file.write_text(file.read_text().replace('2.0 * x', '3.0 * x'))\n"
        "print(f(1.0), len(f.stats.cache_hits))"
    )
    assert python(tmp_path, "-c", edit).split() == ["7.0", "0"]
    again = "from control.block import two_files_away as f\nprint(f(1.0))"
    assert python(tmp_path, "-c", again).split() == ["12.0"]


def test_a_change_in_a_called_file_is_noticed(tmp_path):
    write_packages(tmp_path)

    def run() -> tuple[dict[str, float], set[str]]:
        """Results, and whose code was made anew."""
        lines = python(tmp_path, str(tmp_path / "control/block.py")).splitlines()
        rows = [line.split() for line in lines]
        return {r[0]: float(r[1]) for r in rows}, {r[0] for r in rows if r[2] == "0"}

    expected = dict(RESULTS)
    assert run() == (expected, set(expected))
    assert run() == (expected, set())
    for name, (old, new), changed in EDITS:
        file = tmp_path / name
        assert old in file.read_text()
        file.write_text(file.read_text().replace(old, new))
        expected |= changed
        assert run() == (expected, set(changed)), name


def test_the_planner_notices_a_change_in_the_robots_kernels(tmp_path):
    for room in ("plants", "systems"):
        skip = shutil.ignore_patterns("__pycache__")
        shutil.copytree(ROOT / room, tmp_path / room, ignore=skip)
    program = (
        "from systems.resection.planning.growth import grow\n"
        "from systems.resection.planning.tree import visit\n"
        "print(*(f._cache._impl.locator.get_source_stamp() for f in (grow, visit)))"
    )
    before = python(tmp_path, "-c", program).split()
    with (tmp_path / "plants/snake/inverse_kernels.py").open("a") as stream:
        stream.write("# Changed.\n")
    after = python(tmp_path, "-c", program).split()
    assert before[0] != after[0] and before[1] == after[1]


@pytest.mark.parametrize("house", ["systems", "plants", "diagrams"])
def test_nothing_is_compiled_past_the_decorator(house):
    raw = re.compile(r"\bn?jit\b")
    files = [f for f in (ROOT / house).rglob("*.py") if raw.search(f.read_text())]
    decorator = ROOT / "systems/common/compiled.py"
    assert files == ([decorator] if house == "systems" else [])
