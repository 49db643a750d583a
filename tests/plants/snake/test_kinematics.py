"""Forward kinematics against the paper's equation (1), Figure 4 and differences."""

import math

import numpy as np
import pytest

from plants.snake.jacobian import jacobian
from plants.snake.kinematics import centreline, forward, frames, module_transform
from plants.snake.parameters import SnakeParams
from plants.snake.posture import bends_of, posture_of
from systems.common.parameter import check

PARAMS = SnakeParams()
H = PARAMS.half_pitch


def random_bends(count, seed=0):
    """(s, alpha1, beta1, ..., beta3), (count, 7)."""
    rng = np.random.default_rng(seed)
    q = np.empty((count, 7))
    q[:, 0] = rng.uniform(*PARAMS.travel, count)
    q[:, 1::2] = rng.uniform(-math.pi, math.pi, (count, 3))
    q[:, 2::2] = rng.uniform(0.0, PARAMS.max_bend, (count, 3))
    return q


def equation_1(alpha, beta, h):
    """The matrix as the paper prints it: homogeneous row and column first."""
    ca, sa, cb, sb = math.cos(alpha), math.sin(alpha), math.cos(beta), math.sin(beta)
    off = ca * sa * (cb**2 - sb**2) - ca * sa
    return np.array(
        [
            [1, 0, 0, 0],
            [
                4 * h * ca * sb * cb + 2 * h * ca * sb,
                ca**2 * (cb**2 - sb**2) + sa**2,
                off,
                2 * ca * sb * cb,
            ],
            [
                4 * h * sa * sb * cb + 2 * h * sa * sb,
                off,
                sa**2 * (cb**2 - sb**2) + ca**2,
                2 * sa * sb * cb,
            ],
            [
                2 * h * cb + 2 * h * (-(sb**2) + cb**2),
                -2 * ca * sb * cb,
                -2 * sa * sb * cb,
                cb**2 - sb**2,
            ],
        ]
    )


def turn(axis, angle):
    c, s = math.cos(angle), math.sin(angle)
    i, j = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    X = np.eye(4)
    X[i, i] = X[j, j] = c
    X[i, j], X[j, i] = -s, s
    return X


def up(distance):
    X = np.eye(4)
    X[2, 3] = distance
    return X


@pytest.mark.parametrize("q", random_bends(200))
def test_module_is_equation_1_and_figure_4_and_smooth_in_a_and_b(q):
    alpha, beta = q[1:3]
    X = module_transform(alpha, beta, H)
    printed = equation_1(alpha, beta, H)
    order = [1, 2, 3, 0]  # put the homogeneous row and column last
    np.testing.assert_allclose(X, printed[np.ix_(order, order)], atol=1e-12)
    four_joints = (
        turn("z", alpha)
        @ turn("y", beta)
        @ up(2 * H)
        @ turn("y", beta)
        @ up(2 * H)
        @ turn("z", -alpha)
    )
    np.testing.assert_allclose(X, four_joints, atol=1e-12)
    x = posture_of(q)
    a, b = x[1:3]
    ball = turn("x", a) @ turn("y", b)
    mirrored = turn("y", b) @ turn("x", a)
    np.testing.assert_allclose(X, ball @ up(2 * H) @ mirrored @ up(2 * H), atol=1e-12)
    np.testing.assert_allclose(bends_of(x), q, atol=1e-12)


def test_module_bends_90_degrees():
    X = module_transform(0.0, math.pi / 4, H)
    np.testing.assert_allclose(X[:3, 2], [1.0, 0.0, 0.0], atol=1e-15)


def test_robot_is_the_chain_of_modules_and_tool():
    x = posture_of(random_bends(500))
    X = forward(x, PARAMS)
    points = centreline(x, PARAMS)
    assert X.shape == (500, 4, 4) and points.shape == (500, 8, 3)
    for i in range(500):
        chain = frames(x[i], PARAMS)
        np.testing.assert_allclose(X[i], chain[3] @ up(PARAMS.tool_offset), atol=2e-15)
        np.testing.assert_allclose(points[i, [0, 2, 4, 6]], [c[:3, 3] for c in chain])
    np.testing.assert_allclose(points[:, 7], X[:, :3, 3], atol=1e-17)
    lengths = np.linalg.norm(np.diff(points, axis=1), axis=2)
    np.testing.assert_allclose(lengths[:, :6], 2 * H, rtol=1e-12)


def test_one_posture_and_many_agree():
    x = posture_of(random_bends(6).reshape(2, 3, 7))
    X = forward(x, PARAMS)
    assert X.shape == (2, 3, 4, 4)
    np.testing.assert_array_equal(X[1, 2], forward(x[1, 2], PARAMS))


def test_straight_robot():
    X = forward(np.zeros(7), PARAMS)
    assert X[2, 3] == pytest.approx(12 * H + PARAMS.tool_offset)


def spatial_differences(f, x):
    """V = J xdot by central differences of a pose."""
    J, X0, step = np.zeros((6, 7)), f(x), 1e-6
    for i in range(7):
        d = np.zeros(7)
        d[i] = step
        dX = (f(x + d) - f(x - d)) / (2 * step)
        W = dX[:3, :3] @ X0[:3, :3].T
        J[:, i] = [W[2, 1], W[0, 2], W[1, 0], *dX[:3, 3]]
    return J


@pytest.mark.parametrize("q", random_bends(20, seed=1))
def test_jacobian_matches_differences(q):
    x = posture_of(q)
    expected = spatial_differences(lambda y: forward(y, PARAMS), x)
    np.testing.assert_allclose(jacobian(x, PARAMS), expected, atol=1e-8)


def test_jacobian_is_regular_where_the_papers_parameters_are_not():
    def straight(q):
        return forward(posture_of(q), PARAMS)

    papers = spatial_differences(straight, np.zeros(7))
    assert np.linalg.matrix_rank(papers[:, 1:], tol=1e-6) < 4
    assert np.linalg.matrix_rank(jacobian(np.zeros(7), PARAMS)[:, 1:], tol=1e-9) == 4


def test_a_wrong_shape_is_refused():
    with pytest.raises(ValueError, match=r"shape \(6,\), expected \(..., 7\)"):
        forward(np.zeros(6), PARAMS)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"ball_radius": 2e-3, "half_pitch": 3.6e-3}, r"tan\(max_bend/2\).*R/\(2d\)"),
        ({"half_pitch": 2.9e-3}, "balls of a module overlap"),
        ({"max_bend": 1.0}, "max_bend=1.0 rad: expected >= 0.01 and <= 0.785398"),
        ({"body_radius": 8e-3}, "plates touch at the rim"),
        ({"travel": [0.1, 0.0]}, "travel"),
        ({"first_azimuths": [0.0, 0.0, 1.0]}, "two are 0.0"),
        ({"first_azimuths": [0.0]}, "expected 3 numbers"),
        ({"plate_thickness": 0.0}, "plate_thickness=0.0 m: expected >= 0.0001"),
        ({"tool_offset": -1.0}, "tool_offset"),
    ],
)
def test_geometry_that_cannot_work_is_refused(change, message):
    with pytest.raises(ValueError, match=message):
        check(SnakeParams(**change))
