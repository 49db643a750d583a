"""Statics beside MuJoCo's: ball joints, and tendons that wrap spheres."""

import mujoco
import numpy as np

from plants.snake.balls import gaps, tool_pose, turns_of
from plants.snake.statics import Statics
from tests.plants.snake.test_statics import PARAMS, posture


def model_xml(model):
    """The same balls, plates, holes, wires and masses; no springs, no motors."""
    p, d = model.params, model.drive
    phi, R, h, e = (
        np.ravel(p.azimuths()),
        p.ball_radius,
        p.half_pitch,
        p.plate_thickness,
    )

    def sites(name, z):
        return "".join(
            f'<site name="{name}{i}" pos="{R * np.cos(f)} {R * np.sin(f)} {z}"/>'
            for i, f in enumerate(phi)
        )

    body, close = sites("out0_", -p.face), ""
    for n in range(1, 7):
        # The ball's mass stays where its centre is.
        body += (
            f'<body pos="0 0 {2 * h if n > 1 else 0}"><joint type="ball" name="b{n}"/>'
            f'<geom name="wrap{n}" type="sphere" size="{R}" mass="{d.ball_mass}"/>'
            f'<geom type="sphere" size="1e-4" pos="0 0 {h}" mass="{d.plate_mass}"/>'
            f"{sites(f'in{n}_', h - e / 2)}{sites(f'out{n}_', h + e / 2)}"
        )
        close += "</body>"
    z = 2 * h + p.tool_offset
    body += f'<geom type="sphere" size="1e-4" pos="0 0 {z}" mass="{d.tool_mass}"/>'
    body += f'<site name="tool" pos="0 0 {z}"/>{close}'
    wires = motors = ""
    for w in range(9):
        path = "".join(
            f'<site site="out{n - 1}_{w}"/><geom geom="wrap{n}"/>'
            f'<site site="in{n}_{w}"/>'
            for n in range(1, 2 * (w // 3 + 1) + 1)
        )
        wires += f'<spatial name="w{w}">{path}</spatial>'
        motors += f'<motor tendon="w{w}"/>'
    return (
        '<mujoco><option gravity="0 0 -9.81" jacobian="dense"/>'
        '<default><geom contype="0" conaffinity="0"/></default>'
        f"<worldbody>{body}</worldbody><tendon>{wires}</tendon>"
        f"<actuator>{motors}</actuator></mujoco>"
    )


def test_lengths_and_forces_of_100_load_cases():
    """What is left of MuJoCo's forces, divided by stiffness, is below a nanometre."""
    snake = Statics()
    bare = Statics(gravity=(0.0, 0.0, 0.0))
    model = mujoco.MjModel.from_xml_string(model_xml(snake))
    data = mujoco.MjData(model)
    rng, gap, cases = np.random.default_rng(0), 0.0, 0
    while cases < 100:
        x, force = posture(rng, 0.5), rng.normal(size=3)
        force *= 0.1 / np.linalg.norm(force)
        _, to = snake.energy(turns_of(x), np.zeros(9))
        found = snake.equilibrium(turns_of(x), wound=to.L - 3e-4, force=force)
        if not found.stable:
            continue
        cases += 1
        gap = max(gap, gaps(found.turns)[0].max())
        for i, turn in enumerate(found.turns):
            mujoco.mju_mat2Quat(data.qpos[4 * i : 4 * i + 4], turn.ravel())
        data.ctrl[:] = -found.T
        mujoco.mj_forward(model, data)
        np.testing.assert_allclose(
            data.ten_length, found.L - PARAMS.plate_thickness, atol=1e-9
        )
        site = data.site("tool")
        p = tool_pose(found.turns, 0.0, PARAMS)[:3, 3]
        np.testing.assert_allclose(site.xpos, p, atol=1e-12)
        J = np.zeros((3, model.nv))
        mujoco.mj_jacSite(model, data, J, None, site.id)
        _, core = bare.energy(found.turns, np.zeros(9))
        left = -data.qfrc_actuator + data.qfrc_bias - J.T @ force + core.g
        _, to = snake.energy(found.turns, np.zeros(9), found.L - found.T / 2e4, force)
        moved = tool_jacobian_step(J, to.H, left)
        assert moved < 1e-9
    assert gap > 0.02  # the load cases do part the balls


def tool_jacobian_step(J, H, left):
    """How far the tool would move if these torques were let go, in m."""
    return np.linalg.norm(J @ np.linalg.solve(H, left))
