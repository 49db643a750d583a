"""An arm whose joints are each 0.1 degree off: how far off its tip is.

The tool goes about the cavity for 20 s; the tracker sees where it is, and the arm's
joints say where they believe it to be. What is off is the tip where the arm believes it
to be, against where the tracker's frame, mended by the registration, has it.
"""

import numpy as np
from scipy.interpolate import CubicSpline

from plants.arm.controller_plant import INSTRUMENT_TIP, make_controller_plant
from plants.arm.posture import home_posture
from systems.common.geometry import along
from systems.common.serial_arm import read_arm, tip_frame
from systems.common.signals import Shaft, TrackedShaft
from systems.sensing.optical_tracker import (
    MarkerBody,
    MarkerNoise,
    constants,
    disturb,
)
from systems.sensing.registration import (
    Registration,
    RegistrationParams,
    Seen,
    learnt,
    moved_back,
)

OFFSET = np.deg2rad(0.1)
RATE, SECONDS, PLACES = 60, 20, 12


def path(rng: np.random.Generator) -> CubicSpline:
    """Joint angles over time: from one tip of the cavity to another."""
    plant = make_controller_plant()
    arm = plant.GetJointByName("joint1").model_instance()
    tip = plant.GetFrameByName(INSTRUMENT_TIP)
    low, high = [-0.04, -0.04, -0.15], [0.04, 0.04, -0.09]
    tips = rng.uniform(low, high, (PLACES, 3))
    postures = [home_posture(plant, arm, tip, (0, 0, 0), p) for p in tips]
    return CubicSpline(np.linspace(0.0, SECONDS, PLACES), postures)


def played(seed: int) -> tuple[float, float]:
    """The tip off in m, rms from half the time on: without registration, and with."""
    rng = np.random.default_rng(seed)
    offset = OFFSET * rng.choice([-1.0, 1.0], 7)
    plant = make_controller_plant()
    arm = read_arm(plant, plant.GetFrameByName(INSTRUMENT_TIP))[0]
    params = RegistrationParams(active=True)
    c = Registration(params)._constants[0]
    record = constants(MarkerBody())[0]
    x = np.zeros(6)
    P = np.diag([params.first_shift**2] * 3 + [params.first_turn**2] * 3)
    drift = params.period * np.repeat([params.drift**2, params.turn_drift**2], 3)
    without, mended = [], []
    motion = path(rng)
    for k in range(RATE * SECONDS):
        q = motion(k / RATE)
        p, _, u = tip_frame(arm, q)
        true, _, axis = tip_frame(arm, q + offset)
        noise = MarkerNoise(*(tuple(rng.normal(size=3)) for _ in range(2)))
        shown = disturb(record, Shaft(true, axis), noise)
        seen = Seen(along(p, -c["lever"], u), u, 0.0, 0.0)
        P += np.diag(drift)
        x, P, _ = learnt(c, x, P, seen, TrackedShaft(*shown, 0.0, 1.0))
        if k >= RATE * SECONDS / 2:
            back = moved_back(x, TrackedShaft(true, axis, 0.0, 1.0))
            without.append(np.linalg.norm(np.subtract(true, p)))
            mended.append(np.linalg.norm(np.subtract(back.tip, p)))
    first, last = (np.sqrt(np.mean(np.square(x))) for x in (without, mended))
    return float(first), float(last)


def report(seed: int, scenes: int) -> str:
    """Table of ten seeds, whatever `scenes` is."""
    rows = 1e3 * np.array([played(s) for s in range(seed, seed + 10)])
    return "\n".join(
        f"  {name:22} {np.median(x):.2f} mm rms ({x.min():.2f}-{x.max():.2f})"
        for name, x in zip(("without registration", "with"), rows.T, strict=True)
    )
