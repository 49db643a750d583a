"""Mapping: place and grid of every scan, each by the other."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite, sqrt
from typing import Any

import numpy as np

from plants.turtlebot.lidar import SCAN
from plants.turtlebot.signals import RobotState
from systems.common.block import Block
from systems.common.compiled import compiled, packed
from systems.common.parameter import check, parameter
from systems.common.signal import reader, size, writer
from systems.perception.grid import absorb
from systems.perception.place import Belief, carried, locate
from systems.perception.signals import CELLS, GRID, MOVING, Sureness

SCAN_PERIOD = 0.1
"""Of the lidar, in s."""
read_belief, write_belief = reader(Belief), writer(Belief)
read_robot, write_robot = reader(RobotState), writer(RobotState)


@dataclass
class GridMappingParams:
    """Parameters of place and grid."""

    cell: float = parameter(0.2, "side of a cell", "m", least=0.05, most=1.0)
    x: float = parameter(0.0, "of the grid's middle", "m", least=-100.0, most=100.0)
    y: float = parameter(0.0, "of the grid's middle", "m", least=-100.0, most=100.0)
    clear: float = parameter(
        6.0, "how far a ray tells that nothing stands", "m", above=0.0, most=100.0
    )
    way_error: float = parameter(
        0.02, "of odometry after a metre", "m", above=0.0, most=1.0
    )
    turn_error: float = parameter(
        0.002, "of its heading after a metre or a radian", "rad", above=0.0, most=1.0
    )
    match_error: float = parameter(
        0.3,
        "of a point on a straight line; neighbours share errors, so it is beyond noise",
        "m",
        above=0.0,
        most=1.0,
    )
    map_error: float = parameter(
        0.015, "of the map itself, which no scan betters", "m", least=0.0, most=1.0
    )


def constants(params: GridMappingParams) -> np.ndarray:
    """The parameters as the compiled functions take them."""
    half = 0.5 * CELLS * params.cell
    return packed(params, left=params.x - half, bottom=params.y - half)


@compiled
def mapped(
    params: np.ndarray,
    belief: np.ndarray,
    grid: np.ndarray,
    reckoned: np.ndarray,
    scan: np.ndarray,
    moving: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Belief and grid after another scan, all as ports have them."""
    robot = read_robot(reckoned)
    rows, rays = grid.reshape((len(grid) // 3, 3)), scan.reshape((len(scan), 1))
    walkers = moving.reshape((len(moving) // 6, 6))
    if not isfinite(reckoned.sum() + scan.sum() + moving.sum()):
        return belief.copy(), grid.copy()
    now = locate(params[0], read_belief(belief), robot, rows, rays, walkers)
    place = RobotState(now.x, now.y, now.theta, robot.v, robot.omega)
    new = absorb(params[0], rows, place, rays, walkers)
    return write_belief(now), new.ravel()


@compiled
def place_now(belief: np.ndarray, reckoned: np.ndarray) -> np.ndarray:
    """Where the robot believes to be now."""
    return write_robot(carried(read_belief(belief), read_robot(reckoned)))


class GridMapping(Block):
    """Finds the robot's place, and builds the grid of what stands, from scans.

    Input that is not finite changes neither.

    Port ``reckoned`` accepts the `RobotState` of the odometry.
    Port ``scan`` accepts rows of `Ray`.
    Port ``moving`` accepts rows of `Seen`: what walks, and does not belong to a map.
    Port ``place`` emits the `RobotState` that the robot believes in.
    Port ``sureness`` emits the `Sureness` of it.
    Port ``grid`` emits rows of `Cell`.
    """

    def __init__(self, params: GridMappingParams | None = None) -> None:
        """Makes the block.

        Raises:
            ParameterError: If a parameter is out of range.
        """
        super().__init__()
        params = params or GridMappingParams()
        check(params)
        self._constants = constants(params)
        self._map_error = params.map_error
        self._reckoned = self.signal_in("reckoned", RobotState)
        self._scan = self.signal_in("scan", SCAN)
        self._moving = self.signal_in("moving", MOVING)
        self._belief = self.DeclareDiscreteState([0.0] * size(Belief))
        # Not `state_out`: that port takes ten thousand cells over one by one.
        self._grid = self.DeclareDiscreteState(np.zeros(size(GRID)))
        held = {self.discrete_state_ticket(self._grid)}
        self.signal_out("grid", GRID, lambda c: self._state(c, self._grid), held)
        self.signal_out(
            "place",
            RobotState,
            self._calc_place,
            {self._reckoned.ticket(), self.xd_ticket()},
        )
        self.signal_out("sureness", Sureness, self._calc_sureness, {self.xd_ticket()})
        self.update_every(SCAN_PERIOD, self._update)

    def _state(self, context: Any, group: int) -> np.ndarray:
        state: np.ndarray = context.get_discrete_state(group).value()
        return state

    def _calc_place(self, context: Any) -> np.ndarray:
        belief = self._state(context, self._belief)
        return place_now(belief, self._reckoned.Eval(context))

    def _calc_sureness(self, context: Any) -> list[float]:
        belief = Belief(*self._state(context, self._belief).tolist())
        map_ = self._map_error**2
        return [sqrt(belief.xx + map_), sqrt(belief.yy + map_), sqrt(belief.tt)]

    def _update(self, context: Any) -> Sequence[Any]:
        return mapped(
            self._constants,
            self._state(context, self._belief),
            self._state(context, self._grid),
            self._reckoned.Eval(context),
            self._scan.Eval(context),
            self._moving.Eval(context),
        )
