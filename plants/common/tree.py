"""Kinematics of a plant's bodies, compiled, with the plant's own numbers.

A model is read once. Asked through Drake's classes, every body, point and vector costs
a call, and a context of one's own all that it has computed already: a hundred
microseconds for what takes three.
"""

from math import cos, sin
from typing import Any

import numpy as np
from pydrake.multibody.tree import JointIndex

from systems.common.compiled import Numbers, compiled, packed
from systems.common.geometry import (
    Pose,
    Vector,
    along,
    cross,
    inwards,
    outwards,
    plus,
    row_of,
    scaled,
    set_row,
    sub,
    xyz,
)
from systems.common.serial_arm import turned

WORLD = Pose((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
_JOINTS = {"weld": 0, "revolute": 1, "prismatic": 2}


def read_tree(plant: Any) -> np.ndarray:
    """Reads the bodies of a plant and what joins them.

    Args:
        plant: A finalized MultibodyPlant of welds, revolute and prismatic joints.

    Returns:
        A record for the functions of this module. A body has the row of its index in
        the plant; `order` lists them, each behind the one that carries it.

    Raises:
        ValueError: If there is another joint.
    """
    n = plant.num_bodies()
    parent, kind, at = np.zeros(n, int), np.zeros(n, int), np.zeros(n, int)
    axis, centre, inertia = np.zeros((n, 3)), np.zeros((n, 3)), np.zeros((n, 3, 3))
    before, behind = np.zeros((n, 12)), np.zeros((n, 12))
    mass, carried = np.zeros(n), {0: 0}
    context = plant.CreateDefaultContext()
    for j in range(plant.num_joints()):
        joint = plant.get_joint(JointIndex(j))
        body = joint.child_body()
        i = int(body.index())
        if joint.type_name() not in _JOINTS:
            raise ValueError(f"{joint.name()}: a {joint.type_name()} joint in the tree")
        kind[i] = _JOINTS[joint.type_name()]
        parent[i] = int(joint.parent_body().index())
        X_FM = joint.X_FM() if kind[i] == 0 else None
        if kind[i]:
            at[i] = joint.position_start()
            axis[i] = getattr(
                joint, ("revolute_axis", "translation_axis")[kind[i] - 1]
            )()
        X_PF = joint.frame_on_parent().CalcPoseInBodyFrame(context)
        before[i] = _row(X_PF @ X_FM if X_FM is not None else X_PF)
        behind[i] = _row(joint.frame_on_child().CalcPoseInBodyFrame(context).inverse())
        M = body.CalcSpatialInertiaInBodyFrame(context)
        mass[i], centre[i] = M.get_mass(), M.get_com()
        about = M.CalcRotationalInertia() if mass[i] else None
        if about is not None:
            about = about.ShiftToCenterOfMass(mass[i], centre[i])
            inertia[i] = about.CopyToFullMatrix3()
        carried[i] = parent[i]
    order: list[int] = []
    while len(order) < len(carried) - 1:
        order += [
            i
            for i, p in carried.items()
            if i and i not in order and (p == 0 or p in order)
        ]
    return packed(
        order=np.array(order),
        parent=parent,
        kind=kind,
        at=at,
        axis=axis,
        before=before,
        behind=behind,
        mass=mass,
        centre=centre,
        inertia=inertia,
    )


def _row(X: Any) -> np.ndarray:
    """Origin, and axes x, y, z of a frame, (12,)."""
    return np.concatenate([X.translation(), X.rotation().matrix().T.ravel()])


@compiled
def pose_in(rows: np.ndarray, i: int) -> Pose:
    """The pose in a row (n, 12)."""
    r = rows[i]
    return Pose(xyz(r, 0), xyz(r, 3), xyz(r, 6), xyz(r, 9))


@compiled
def placed_in(A: Pose, B: Pose) -> Pose:
    """A frame that is given in frame A, in W."""
    p = plus(A.p, outwards(A, B.p))
    return Pose(p, outwards(A, B.x), outwards(A, B.y), outwards(A, B.z))


@compiled
def move_tree(tree: Any, q: Numbers, v: Numbers, X: np.ndarray, V: np.ndarray) -> None:
    """Poses and velocities of all bodies.

    Args:
        tree: A record of `read_tree`.
        q: Positions.
        v: Velocities.
        X: Filled with origin and axes of each body (n, 12).
        V: Filled with angular velocity and that of the origin (n, 6).
    """
    for k in range(3):
        X[0, k] = 0.0
        X[0, 3 + 4 * k] = 1.0
    for i in tree.order:
        parent = tree.parent[i]
        P = pose_in(X, parent)
        F = placed_in(P, pose_in(tree.before, i))
        w, u = xyz(V[parent], 0), xyz(V[parent], 3)
        axis, M = outwards(F, row_of(tree.axis, i)), F
        if tree.kind[i] == 1:
            c, s = cos(q[tree.at[i]]), sin(q[tree.at[i]])
            M = Pose(
                F.p,
                turned(F.x, axis, c, s),
                turned(F.y, axis, c, s),
                turned(F.z, axis, c, s),
            )
        elif tree.kind[i] == 2:
            M = Pose(along(F.p, q[tree.at[i]], axis), F.x, F.y, F.z)
        B = placed_in(M, pose_in(tree.behind, i))
        u = plus(u, cross(w, sub(B.p, P.p)))
        if tree.kind[i] == 1:
            turn = scaled(v[tree.at[i]], axis)
            w, u = plus(w, turn), plus(u, cross(turn, sub(B.p, F.p)))
        elif tree.kind[i] == 2:
            u = along(u, v[tree.at[i]], axis)
        set_row(X[i].reshape((4, 3)), 0, B.p)
        set_row(X[i].reshape((4, 3)), 1, B.x)
        set_row(X[i].reshape((4, 3)), 2, B.y)
        set_row(X[i].reshape((4, 3)), 3, B.z)
        set_row(V[i].reshape((2, 3)), 0, w)
        set_row(V[i].reshape((2, 3)), 1, u)


@compiled
def momentum(tree: Any, i: int, X: np.ndarray, V: np.ndarray) -> tuple[Vector, Vector]:
    """A body's angular momentum about the world's origin, and its linear one.

    Args:
        tree: A record of `read_tree`.
        i: The body's row.
        X: Of `move_tree`.
        V: Of `move_tree`.
    """
    B, w = pose_in(X, i), xyz(V[i], 0)
    lever = outwards(B, row_of(tree.centre, i))
    linear = scaled(tree.mass[i], plus(xyz(V[i], 3), cross(w, lever)))
    turn, own = inwards(B, w), (0.0, 0.0, 0.0)
    for k in range(3):
        own = along(own, turn[k], row_of(tree.inertia[i], k))
    return plus(outwards(B, own), cross(plus(B.p, lever), linear)), linear


@compiled
def mass_centre(tree: Any, i: int, X: np.ndarray) -> Vector:
    """A body's centre of mass in W."""
    B = pose_in(X, i)
    return plus(B.p, outwards(B, row_of(tree.centre, i)))
