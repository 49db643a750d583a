"""Resection: feasibility, map, plan and reach in a tumour of some 65 cm3."""

from collections.abc import Callable
import resource
from time import process_time

import numpy as np

from plants.snake.parameters import SnakeParams
from plants.tissue.tissue import SyntheticTumour, synthetic_tumour
from plants.tissue.volume import Access, make_volume
from systems.common.compiled import rehearse
from systems.resection.planning.feasibility_map import feasibility_map
from systems.resection.planning.planner import Planner
from systems.resection.planning.procedure import Procedure
from systems.resection.planning.reach import find_reach
from systems.resection.planning.session import Session
from systems.resection.planning.sweep import intermediate

LENGTH = 0.058
"""Of the tumour's bounding box in m: some 65 cm3."""


def new_session(seed: int, length: float = LENGTH) -> Session:
    """A session at its beginning, voxels of 0.5 mm."""
    tissue = synthetic_tumour(SyntheticTumour(length=length, seed=seed))
    access = Access(direction=[0.0, 0.0, -1.0])
    return Session(make_volume(tissue, access, 4e-3), SnakeParams())


def random_procedure(session: Session, rng: np.random.Generator) -> Procedure:
    """One of 12 mm, rings 3 mm apart, somewhere the tool has been."""
    x = session.postures[rng.integers(len(session.postures))].copy()
    x[1:5] += rng.normal(size=4) * 0.05
    p, n = map(np.array, intermediate(session.body, x))
    ahead = session.params.straight_module + session.params.tool_offset
    position = (p + ahead * n / np.linalg.norm(n)).tolist()
    radius = float(rng.uniform(0.008, 0.016))
    clipped = bool(rng.integers(2))
    return Procedure("elementary", position, n.tolist(), 0.012, radius, clipped, 3e-3)


def report(seed: int, scenes: int) -> str:
    """Processor time of each part; `scenes` procedures are checked."""
    rehearse(lambda: measure(lambda: new_session(seed, 0.02), seed, 1))
    return measure(lambda: new_session(seed), seed, scenes)


def measure(make: Callable[[], Session], seed: int, scenes: int) -> str:
    """What `report` says, of the sessions that `make` makes."""
    session = make()
    lines = [f"  tumour {1e6 * session.volume.tumour_volume:.1f} cm3, 0.5 mm voxels"]
    start = process_time()
    reach = find_reach(session, seed)
    spent = process_time() - start
    lines.append(f"  reachable {reach.fraction:.4f} in {spent:.1f} s")
    start = process_time()
    twice = find_reach(session, seed, 2.0, explain=False)
    spent = process_time() - start
    lines.append(f"  with twice the effort {twice.fraction:.4f} in {spent:.1f} s")
    planner = Planner(session, reach)
    planner.enter()
    rng = np.random.default_rng(seed)
    times = []
    for _ in range(min(scenes, 100)):
        procedure = random_procedure(session, rng)
        start = process_time()
        session.check(procedure)
        times.append(process_time() - start)
    middle, most = np.percentile(times, [50, 90]) * 1e3
    lines.append(f"  feasibility {middle:.1f} ms median, {most:.1f} ms nine in ten")
    start = process_time()
    found = feasibility_map(session, 1000)
    lines.append(
        f"  map of {len(found.points)} in {process_time() - start:.2f} s, "
        f"{found.feasible.mean():.0%} feasible"
    )
    session = make()
    start = process_time()
    Planner(session, reach).run()
    lines.append(
        f"  plan of {session.fraction / reach.fraction:.4f} of the reachable part in "
        f"{process_time() - start:.1f} s, {len(session.steps)} steps"
    )
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    lines.append(f"  memory {memory:.2f} GB")
    return "\n".join(lines)
