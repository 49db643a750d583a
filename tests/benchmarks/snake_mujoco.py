"""The snake as a MuJoCo model: the same bodies, joints, balls and wires.

MuJoCo's spatial tendons wrap spheres, so its wires run as the paper's do, but for
the plate between a module's balls: it rolls against the torsion-free plate, and the
tendon's sites with it. Commands are therefore MuJoCo's own tendon lengths at the
reference postures, not equations (2) and (3).
"""

import numpy as np

from plants.snake.drive import SnakeDriveParams
from plants.snake.parameters import STOP, SnakeParams


def _body(name: str, p: SnakeParams, mass: float, is_ball: bool, joint: str) -> str:
    """Opens a body that turns about the parent's end, with Drake's inertia."""
    R, r, h = p.ball_radius, p.body_radius, p.half_pitch
    if is_ball:
        across = along = 0.4 * R * R * mass
        centre = 0.0
    else:
        across, along = (3 * r * r + h * h) / 12 * mass, r * r / 2 * mass
        centre = h
    axis = "1 0 0" if joint[0] == "a" else "0 1 0"
    stop = p.max_bend + STOP
    # The far ball of a module sits 2h beyond the plate's own.
    z = 2 * h if is_ball and name != "ball1" else 0.0
    return (
        f'<body name="{name}" pos="0 0 {z}">'
        f'<inertial pos="0 0 {centre}" mass="{mass}" '
        f'diaginertia="{across} {across} {along}"/>'
        f'<joint name="{joint}" axis="{axis}" range="{-stop} {stop}"/>'
    )


def _sites(name: str, p: SnakeParams) -> str:
    """Nine holes on a plate's two faces, h past its ball."""
    lines, h, e, R = [], p.half_pitch, p.plate_thickness, p.ball_radius
    for i, phi in enumerate(np.ravel(p.azimuths())):
        x, y = R * np.cos(phi), R * np.sin(phi)
        for face, z in (("in", h - e / 2), ("out", h + e / 2)):
            lines.append(f'<site name="{name}_{face}{i}" pos="{x} {y} {z}"/>')
    return "".join(lines)


def model_xml(
    p: SnakeParams, d: SnakeDriveParams, step: float, tendons: bool, softness: float
) -> str:
    """The model's XML.

    Args:
        p: Geometry.
        d: Masses and gains.
        step: In s.
        tendons: Wires as spatial tendons, pulled by actuators of wire stiffness;
            else servos on the near angles.
        softness: Time constant of the couplers in steps; MuJoCo asks for 2 or more.
    """
    h, R = p.half_pitch, p.ball_radius
    ball = f'<geom type="sphere" size="{R}" contype="0" conaffinity="0" mass="0"'
    chain, close = "", ""
    for k in (1, 2, 3):
        for near, joints in ((1, (f"a{k}", f"b{k}")), (0, (f"b{k}_far", f"a{k}_far"))):
            n = 2 * k - near
            chain += _body(f"ball{n}", p, d.ball_mass, True, joints[0])
            chain += f'{ball} name="wrap{n}"/>'
            chain += _body(f"plate{n}", p, d.plate_mass, False, joints[1])
            chain += _sites(f"plate{n}", p)
            close += "</body></body>"
    tool = 2 * h + p.tool_offset
    inertia = 0.4 * p.tool_radius**2 * d.tool_mass
    chain += (
        f'<body pos="0 0 {tool}"><inertial pos="0 0 0" mass="{d.tool_mass}" '
        f'diaginertia="{inertia} {inertia} {inertia}"/><site name="tool"/></body>'
    )
    base = "".join(
        f'<site name="plate0_out{i}" pos="{R * np.cos(f)} {R * np.sin(f)} {-p.face}"/>'
        for i, f in enumerate(np.ravel(p.azimuths()))
    )
    couplers = "".join(
        f'<joint joint1="{x}{k}_far" joint2="{x}{k}" polycoef="0 1 0 0 0" '
        f'solref="{softness * step} 1"/>'
        for k in (1, 2, 3)
        for x in "ab"
    )
    wires, motors = "", ""
    for w in range(9):
        sites = "".join(
            f'<site site="plate{n - 1}_out{w}"/><geom geom="wrap{n}"/>'
            f'<site site="plate{n}_in{w}"/>'
            for n in range(1, 2 * (w // 3 + 1) + 1)
        )
        wires += f'<spatial name="wire{w}">{sites}</spatial>'
        motors += (
            f'<general tendon="wire{w}" biastype="affine" gainprm="{d.wire_stiffness}" '
            f'biasprm="0 {-d.wire_stiffness} {-d.wire_damping}" '
            'forcelimited="true" forcerange="-1000 0"/>'
        )
    if not tendons:
        motors = "".join(
            f'<position joint="{x}{k}" kp="{d.kp}" kv="{d.kd}"/>'
            for k in (1, 2, 3)
            for x in "ab"
        )
    slide = f'<position joint="s" kp="{d.travel_kp}" kv="{d.travel_kd}"/>'
    return (
        '<mujoco><compiler angle="radian" autolimits="true"/>'
        f'<option timestep="{step}" integrator="implicitfast"/>'
        f'<default><joint damping="{d.friction}"/></default><worldbody>'
        f'<body name="carriage"><inertial pos="0 0 {-h}" mass="{d.carriage_mass}" '
        'diaginertia="1e-6 1e-6 1e-6"/><joint name="s" type="slide" axis="0 0 1"/>'
        f"{base}{chain}{close}</body></worldbody>"
        f"<equality>{couplers}</equality>"
        f"<tendon>{wires}</tendon><actuator>{slide}{motors}</actuator></mujoco>"
    )
