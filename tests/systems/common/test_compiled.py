"""Compiled functions: their parameters, and a cache that notices changes."""

from dataclasses import dataclass, field
import os
from pathlib import Path
import subprocess
import sys
import textwrap

import numba
import numpy as np

from systems.common.compiled import announced, compiled, packed


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


def test_a_change_in_a_called_file_is_noticed(tmp_path):
    (tmp_path / "low.py").write_text(
        textwrap.dedent("""\
        from systems.common.compiled import compiled

        @compiled
        def low(x):
            return x + 1.0
        """)
    )
    (tmp_path / "middle.py").write_text(
        textwrap.dedent("""\
        from low import low
        from systems.common.compiled import compiled

        @compiled
        def middle(x):
            return low(x)
        """)
    )
    (tmp_path / "high.py").write_text(
        textwrap.dedent("""\
        from middle import middle
        from systems.common.compiled import compiled

        @compiled
        def high(x):
            return middle(x)

        print(high(1.0), sum(high.stats.cache_hits.values()))
        """)
    )

    def run() -> str:
        root = str(Path(__file__).parents[3])
        path = os.pathsep.join([str(tmp_path), root])
        return subprocess.run(
            [sys.executable, "-B", str(tmp_path / "high.py")],
            env=os.environ | {"PYTHONPATH": path},
            check=True,
            capture_output=True,
            text=True,
        ).stdout.split()

    assert run() == ["2.0", "0"]
    assert run() == ["2.0", "1"]
    low = (tmp_path / "low.py").read_text()
    (tmp_path / "low.py").write_text(low.replace("1.0", "2.0"))
    assert run() == ["3.0", "0"]
