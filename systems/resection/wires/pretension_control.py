"""Pretension control: winds a wire that its load cell finds too slack.

Lengths alone do not do that: a drum that errs by 0.1 mm errs by 2 N. Each wire has an
integrator u, by which it is wound shorter than asked for,

    u' = clip(k_i (T_0 - T) / k, +-rate),   0 <= u <= limit,

so that one that is taut enough is let go of again, no further than it was asked for. At
its limits the integrator stands: it does not wind up. A cell that fails leaves all
drums where they are, for good, and says so by its code.
"""

from dataclasses import dataclass
from enum import IntEnum
from typing import Annotated, Any, NamedTuple

import numpy as np

from plants.snake.drive import SnakeDriveParams
from plants.snake.signals import Drums, Numbers, Tensions
from plants.snake.statics_kernels import ROPES
from systems.common.compiled import compiled, packed
from systems.common.geometry import all_finite
from systems.common.parameter import Rules, check, parameter
from systems.common.signal import Field, example
from systems.common.step_block import StepBlock


class Cell(IntEnum):
    """Why the drums stand."""

    GOOD = 0
    NO_NUMBER = 1
    OUT_OF_RANGE = 2
    STUCK = 3


class CellCode(NamedTuple):
    """Whether the load cells are to be believed."""

    code: Annotated[float, Field("1", "a `Cell`", 0.0)]
    wire: Annotated[float, Field("1", "whose cell failed, -1 for none", -1.0)]


class CellNoise(NamedTuple):
    """What errs in a sample: independent standard normal numbers."""

    cells: Annotated[Numbers, Field("1", "of each cell", (0.0,) * ROPES)]


@dataclass
class PretensionControlParams:
    """Parameters of `PretensionControl` and of its load cells."""

    period: float = parameter(0.02, "of the controller", "s", least=1e-3, most=0.1)
    tension: float = parameter(
        0.3, "T_0 that each wire is to have at least", "N", least=0.0, most=20.0
    )
    gain: float = parameter(
        20.0, "k_i: share of the want taken up in a second", "1/s", above=0.0, most=50.0
    )
    rate: float = parameter(
        0.01, "largest speed of winding", "m/s", least=1e-4, most=0.1
    )
    limit: float = parameter(
        2e-3, "most that a wire is wound besides", "m", least=0.0, most=0.01
    )
    bias: list[float] = parameter(
        [0.0] * ROPES, "of the cells", "N", least=-5.0, most=5.0, shape=(ROPES,)
    )
    noise: float = parameter(
        0.02, "standard deviation of a sample", "N", least=0.0, most=1.0
    )
    range: float = parameter(
        50.0, "beyond which a cell is not believed", "N", above=0.0, most=1e3
    )
    same: int = parameter(
        10, "samples without any change that mean a stuck cell", least=2, most=1000
    )

    def rules(self) -> Rules:
        """An integrator does not take up more in a period than there is."""
        most = f"at most 1 / period={1 / self.period:g} 1/s"
        yield self.gain * self.period <= 1.0, "gain", most


@compiled
def judged(
    c: Any, measured: np.ndarray, last: np.ndarray, same: np.ndarray, code: CellCode
) -> CellCode:
    """The code, which stays once a cell has failed; counts equal samples in `same`."""
    for w in range(ROPES):
        same[w] = same[w] + 1.0 if measured[w] == last[w] else 0.0
        if code.code == 0.0:
            if not np.isfinite(measured[w]):
                code = CellCode(1.0, float(w))
            elif abs(measured[w]) > c.range:
                code = CellCode(2.0, float(w))
            elif same[w] >= c.same and c.noise > 0.0:
                code = CellCode(3.0, float(w))
    return code


@compiled
def taken_up(c: Any, u: np.ndarray, measured: np.ndarray) -> np.ndarray:
    """By how much each wire is wound besides after a period, (9,) in m."""
    rate = c.gain * (c.tension - measured) / c.stiffness
    rate = np.minimum(np.maximum(rate, -c.rate), c.rate)
    return np.minimum(np.maximum(u + c.period * rate, 0.0), c.limit)


@compiled
def _update(
    c: Any,
    memory: np.ndarray,
    drums: Drums,
    code: CellCode,
    command: Drums,
    tension: Tensions,
    noise: CellNoise,
) -> tuple[np.ndarray, Drums, CellCode]:
    """Integrators, last samples and equal ones in a row (3, 9); what is commanded."""
    after = memory.copy().reshape((3, ROPES))
    measured = np.array(tension.T) + c.bias + c.noise * np.array(noise.cells)
    code = judged(c, measured, after[1], after[2], code)
    after[1] = measured
    wires: Any = np.array(command.wires)
    if code.code != 0.0 or not (all_finite(wires) and np.isfinite(command.s)):
        wires[:] = np.array(drums.wires)
        return after.ravel(), Drums(wires, drums.s), code
    after[0] = taken_up(c, after[0], measured)
    wires -= after[0]
    return after.ravel(), Drums(wires, command.s), code


class PretensionControl(StepBlock):
    """Keeps the slackest wires at their set tension, by load cells at the drums.

    It stands between what winds and the drums, and costs them a period. Cells err by a
    bias each and by noise. What is no command leaves the last one.

    Port ``command`` accepts the `Drums` asked for.
    Port ``tension`` accepts the true `Tensions` at the drums.
    Port ``noise`` accepts the `CellNoise`, renewed every period.
    Port ``drums`` emits the `Drums` that keep wires taut.
    Port ``cell`` emits the `CellCode`: of one that has failed, for good.
    """

    def __init__(
        self,
        params: PretensionControlParams | None = None,
        drive: SnakeDriveParams | None = None,
        drums: Drums | None = None,
    ) -> None:
        """Makes the block for a drive; all wires are drawn taut by T_0 at the start."""
        super().__init__()
        params = check(params or PretensionControlParams())
        drive = check(drive or SnakeDriveParams())
        taken = min(params.tension / drive.wire_stiffness, params.limit)
        start = drums or example(Drums)
        taut: Any = tuple(wire - taken for wire in start.wires)
        self.declare_update(
            _update,
            [packed(params, stiffness=drive.wire_stiffness)],
            {"command": Drums, "tension": Tensions, "noise": CellNoise},
            {
                "_memory": np.repeat([taken, np.nan, 0.0], ROPES),
                "drums": start._replace(wires=taut),
                "cell": CellCode(float(Cell.GOOD), -1.0),
            },
            params.period,
            timed=False,
        )
