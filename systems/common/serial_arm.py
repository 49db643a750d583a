"""Kinematics of an arm of revolute joints, compiled, with the plant's own numbers.

A plant's model is read once, at its zero posture: axes and origins of the joints, the
tool's tip, its shaft and its weight. From then on a posture turns all that stands
behind each joint about the joint's axis (product of exponentials: Murray, Li, Sastry
1994, section 3.2.2). Everything is in the world frame W, SI units.
"""

from math import cos, sin
from typing import Any

import numpy as np
from pydrake.multibody.tree import ModelInstanceIndex

from systems.common.compiled import Numbers, compiled, packed
from systems.common.geometry import Vector, along, cross, dot, sub, xyz


def read_arm(plant: Any, tip: Any) -> np.ndarray:
    """Reads an arm and the tool that it carries from its plant.

    Args:
        plant: A finalized MultibodyPlant with nothing but revolute joints, in a
            chain. All that gravity acts on is taken to hang behind the last one.
        tip: The frame at the tool's tip, z along its shaft.

    Returns:
        A record for the functions of this module, at q = 0: `axes` and `origins` of
        the joints (n x 3), `tip` and `shaft` (3), `centre` of the load's mass (3) and
        the load's `weight` in N (3), and the tip frame's axis `across` (3), its x.
    """
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, np.zeros(plant.num_positions()))
    joints = [plant.get_joint(index) for index in plant.GetJointIndices()]
    moving = [joint for joint in joints if joint.num_positions() == 1]
    moving.sort(key=lambda joint: joint.position_start())
    axes, origins = [], []
    for joint in moving:
        X_WJ = joint.frame_on_parent().CalcPoseInWorld(context)
        axes.append(X_WJ.rotation().multiply(joint.revolute_axis()))
        origins.append(X_WJ.translation())
    instances = map(ModelInstanceIndex, range(1, plant.num_model_instances()))
    loads = [instance for instance in instances if plant.is_gravity_enabled(instance)]
    mass = plant.CalcTotalMass(context, loads)
    X_WT = tip.CalcPoseInWorld(context)
    return packed(
        axes=np.array(axes),
        origins=np.array(origins),
        tip=X_WT.translation(),
        shaft=X_WT.rotation().col(2),
        across=X_WT.rotation().col(0),
        centre=plant.CalcCenterOfMassPositionInWorld(context, loads),
        weight=mass * plant.gravity_field().gravity_vector(),
    )


@compiled
def turned(v: Vector, axis: Vector, c: float, s: float) -> Vector:
    """v, turned about a unit vector by the angle of cosine c and sine s (Rodrigues)."""
    straight = along((c * v[0], c * v[1], c * v[2]), s, cross(axis, v))
    return along(straight, (1.0 - c) * dot(axis, v), axis)


@compiled
def placed(frame: tuple[Vector, Vector, Vector, Vector], p: Vector) -> Vector:
    """A point given at q = 0, after the motion `frame`: images of 0, x, y and z."""
    o, x, y, z = frame
    return along(along(along(o, p[0], x), p[1], y), p[2], z)


@compiled
def walk(
    arm: Any, q: Numbers, axes: np.ndarray, origins: np.ndarray
) -> tuple[Vector, Vector, Vector, Vector]:
    """Walks the chain at a posture.

    Args:
        arm: A record of `read_arm`.
        q: Joint positions (n) [rad].
        axes: Filled with the joints' axes (n x 3).
        origins: Filled with points on them (n x 3) [m].

    Returns:
        The tip p_WT [m], the axes x and z of its frame, z along the shaft, and the
        load's centre of mass.
    """
    zero = (0.0, 0.0, 0.0)
    frame = (zero, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    for i in range(len(arm.axes)):
        o, x, y, z = frame
        a = sub(placed(frame, xyz(arm.axes[i], 0)), o)
        p = placed(frame, xyz(arm.origins[i], 0))
        for k in range(3):
            axes[i, k] = a[k]
            origins[i, k] = p[k]
        c, s = cos(q[i]), sin(q[i])
        moved = along(p, 1.0, turned(sub(o, p), a, c, s))
        frame = (moved, turned(x, a, c, s), turned(y, a, c, s), turned(z, a, c, s))
    tip = placed(frame, xyz(arm.tip, 0))
    x = sub(placed(frame, xyz(arm.across, 0)), frame[0])
    shaft = sub(placed(frame, xyz(arm.shaft, 0)), frame[0])
    return tip, x, shaft, placed(frame, xyz(arm.centre, 0))


@compiled
def tip_frame(arm: Any, q: Numbers) -> tuple[Vector, Vector, Vector]:
    """p_WT of the tip at a posture (n) [rad], and the axes x and z of its frame T."""
    n = len(arm.axes)
    tip, x, z, _ = walk(arm, q, np.empty((n, 3)), np.empty((n, 3)))
    return tip, x, z


@compiled
def tip_position(arm: Any, q: Numbers) -> Vector:
    """p_WT of the tool's tip at a posture (n) [rad], in m."""
    return tip_frame(arm, q)[0]


@compiled
def tool_state(arm: Any, q: Numbers) -> tuple[Vector, Vector, np.ndarray, np.ndarray]:
    """Pose of the tool, its Jacobian and the load at a posture.

    Args:
        arm: A record of `read_arm`.
        q: Joint positions (n) [rad].

    Returns:
        p_WT [m], u_WT, the tip's spatial velocity Jacobian J (6 x n), with
        [w_WT; v_WT] = J v, and the joint torques that the load's weight makes (n)
        [Nm].
    """
    n = len(arm.axes)
    axes, origins = np.empty((n, 3)), np.empty((n, 3))
    tip, _, shaft, centre = walk(arm, q, axes, origins)
    J, torque = np.empty((6, n)), np.empty(n)
    weight = xyz(arm.weight, 0)
    for i in range(n):
        a, o = xyz(axes[i], 0), xyz(origins[i], 0)
        v = cross(a, sub(tip, o))
        for k in range(3):
            J[k, i] = a[k]
            J[3 + k, i] = v[k]
        torque[i] = dot(a, cross(sub(centre, o), weight))
    return tip, shaft, J, torque
