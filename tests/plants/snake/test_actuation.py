"""Wire lengths both ways against a taut string, and the paper's elimination."""

import math

import numpy as np
from numpy.polynomial import Polynomial
import pytest

from plants.snake.actuation import (
    angles_of_lengths,
    checked_angles,
    length_range,
    norm_of_length,
    wire_lengths,
)
from plants.snake.kinematics import module_transform
from plants.snake.parameters import SnakeParams
from plants.snake.posture import posture_of
from plants.snake.two_wires import all_solutions, solve
from systems.common.parameter import check

PARAMS = SnakeParams()
R, E, H = PARAMS.ball_radius, PARAMS.plate_thickness, PARAMS.half_pitch
D = PARAMS.face


def random_bends(count, seed=0):
    """(0, alpha1, beta1, ..., beta3), (count, 7)."""
    rng = np.random.default_rng(seed)
    q = np.zeros((count, 7))
    q[:, 1::2] = rng.uniform(-math.pi, math.pi, (count, 3))
    q[:, 2::2] = rng.uniform(0.0, PARAMS.max_bend, (count, 3))
    return q


def lengths_of(q, params=PARAMS):
    return wire_lengths(posture_of(q), params)


def taut_string(p, q, radius):
    """Shortest path from p to q (n, 3) round a ball at the origin, and contact."""
    along = q - p
    t = -(p * along).sum(1) / (along * along).sum(1)
    closest = p + np.clip(t, 0, 1)[:, None] * along
    contact = np.linalg.norm(closest, axis=1) < radius
    a, b = np.linalg.norm(p, axis=1), np.linalg.norm(q, axis=1)
    tangents = np.sqrt(a**2 - radius**2) + np.sqrt(b**2 - radius**2)
    between = np.arccos(np.clip((p * q).sum(1) / (a * b), -1, 1))
    arc = radius * (between - np.arccos(radius / a) - np.arccos(radius / b))
    return np.where(contact, tangents + arc, np.linalg.norm(along, axis=1)), contact


def test_lengths_are_those_of_a_taut_string():
    q = random_bends(20_000)
    q[:, 3:] = 0.0  # module 1 bends, wire 0 at azimuth 0
    lengths = lengths_of(q)[:, 0]
    lower = np.tile([R, 0.0, -D], (len(q), 1))  # P_i from the ball's centre
    # A ball turns by Rz(alpha) Ry(beta) Rz(-alpha), half of equation (1)'s bend.
    J = module_transform(q[:, 1], q[:, 2] / 2, H)[:, :3, :3]
    upper = J @ np.array([R, 0.0, D])
    taut, contact = taut_string(lower, upper, R)
    assert 0.4 < contact.mean() < 0.6
    assert np.abs(lengths - (2 * taut + 2 * E)).max() <= 1e-10


def test_distal_wires_add_up():
    q = random_bends(50)
    L = lengths_of(q)
    for m in range(3):
        only = np.zeros_like(q)
        only[:, 1 + 2 * m : 3 + 2 * m] = q[:, 1 + 2 * m : 3 + 2 * m]
        alone = lengths_of(only) - wire_lengths(np.zeros(7), PARAMS)
        assert np.abs(alone[:, : 3 * m]).max(initial=0.0) < 1e-15
        L = L - alone
    np.testing.assert_allclose(L, np.tile(wire_lengths(np.zeros(7), PARAMS), (50, 1)))
    assert wire_lengths(np.zeros(7), PARAMS)[8] == pytest.approx(12 * H)


def test_stroke_of_a_module():
    """The reference page's figures for R = 3, e = 1, h = 3.2 mm."""
    low, high = length_range(PARAMS)
    assert low[0] - 4 * H == pytest.approx(-5.414e-3, abs=1e-6)
    assert high[0] - 4 * H == pytest.approx(4.712e-3, abs=1e-6)
    L = lengths_of(random_bends(20_000))
    assert (low <= L.min(0)).all() and (L.max(0) <= high).all()


def test_forward_after_inverse_on_100000_postures():
    q = random_bends(100_000, seed=3)
    found = angles_of_lengths(lengths_of(q), PARAMS)
    assert np.abs(found.residual).max() < 1e-12
    assert np.abs(found.ab - posture_of(q)[:, 1:]).max() < 1e-10


def test_straight_lengths_give_no_bend():
    found = angles_of_lengths(wire_lengths(np.zeros(7), PARAMS), PARAMS)
    assert np.abs(found.ab).max() < 1e-15


def test_two_wires_have_two_solutions_of_which_one_counts():
    phi = PARAMS.azimuths()[0]
    for q in random_bends(2000, seed=5):
        q[3:] = 0.0
        L = lengths_of(q)
        for i, j in ((0, 1), (1, 2), (2, 0)):
            pair, at = (L[i], L[j]), (phi[i], phi[j])
            found = all_solutions(pair, at, PARAMS)
            assert len(found) == 2
            assert found[1, 1] > PARAMS.max_bend  # the other one is out of bounds
            alpha, beta = solve(pair, at, PARAMS)
            assert beta == pytest.approx(q[2], abs=1e-9)
            turn = np.angle(np.exp(1j * (alpha - q[1])))
            assert abs(turn * math.sin(beta / 2)) < 1e-9


def test_where_the_inequality_fails_two_postures_share_two_lengths():
    loose = SnakeParams(ball_radius=2e-3, half_pitch=3.6e-3)
    with pytest.raises(ValueError, match=r"R/\(2d\)"):
        check(loose)
    rng = np.random.default_rng(0)
    both = 0
    for _ in range(1000):
        q = np.zeros(7)
        q[1:3] = rng.uniform(-math.pi, math.pi), rng.uniform(0, math.pi / 4)
        L = lengths_of(q, loose)
        phi = loose.azimuths()[0]
        found = all_solutions((L[0], L[1]), (phi[0], phi[1]), loose)
        both += bool(len(found) == 2 and found[1, 1] <= math.pi / 4)
    assert both > 20


def dialytic(p, phi):
    """The paper's route [18]: tangents of half angles, resultant, its real roots.

    With x = tan(alpha/2), y = tan(beta/2), each squared norm is a quadratic in y
    whose coefficients are polynomials in x; the resultant is (1 + x^2)^4 times an
    octic in x.
    """
    one = Polynomial([1.0, 0.0, 1.0])  # 1 + x^2
    quadratics = []
    for p_i, f in zip(p, phi, strict=True):
        cosine = Polynomial([math.cos(f), 2 * math.sin(f), -math.cos(f)])
        quadratics.append(
            (
                4 * R**2 * cosine**2 - p_i**2 * one**2,
                -8 * D * R * cosine * one,
                (4 * D**2 - p_i**2) * one**2,
            )
        )
    (a1, b1, c1), (a2, b2, c2) = quadratics
    # The 4 x 4 Sylvester determinant of two quadratics in y.
    resultant = (a1 * c2 - a2 * c1) ** 2 - (a1 * b2 - a2 * b1) * (b1 * c2 - b2 * c1)
    octic, remainder = divmod(resultant, one**4)
    assert octic.degree() == 8
    assert np.abs(remainder.coef).max() < 1e-9 * np.abs(resultant.coef).max()
    for x in octic.roots():
        if abs(x.imag) > 1e-6 * (1 + abs(x)):
            continue
        A1, B1, C1, A2, B2, C2 = (poly(x.real) for poly in (a1, b1, c1, a2, b2, c2))
        y = -(A1 * C2 - A2 * C1) / (A1 * B2 - A2 * B1)
        yield 2 * math.atan(x.real), 2 * math.atan(y)


def test_dialytic_elimination_agrees():
    phi = PARAMS.azimuths()[0][:2]
    rng = np.random.default_rng(8)
    for _ in range(200):
        q = np.zeros(7)
        q[1:3] = rng.uniform(-3.0, 3.0), rng.uniform(0.1, PARAMS.max_bend)
        L = lengths_of(q)[:2]
        p = [norm_of_length(x, R, E, H) for x in L]
        right = [
            (alpha, beta)
            for alpha, beta in dialytic(p, phi)
            if 0.0 < beta <= PARAMS.max_bend + 1e-6
            and all(
                2 * D * math.cos(beta / 2)
                > 2 * R * math.sin(beta / 2) * math.cos(f - alpha)
                for f in phi
            )
            and all(
                abs(
                    2 * D * math.cos(beta / 2)
                    - 2 * R * math.sin(beta / 2) * math.cos(f - alpha)
                    - p_i
                )
                < 1e-6
                for f, p_i in zip(phi, p, strict=True)
            )
        ]
        assert len(right) == 1
        np.testing.assert_allclose(
            right[0], solve(tuple(L), tuple(phi), PARAMS), atol=1e-6
        )


def test_residual_tells_a_slack_wire():
    q = random_bends(1, seed=2)[0]
    L = lengths_of(q)
    assert np.abs(angles_of_lengths(L, PARAMS).residual).max() < 1e-12
    for w in range(9):
        slack = L.copy()
        slack[w] += 0.2e-3
        residual = angles_of_lengths(slack, PARAMS).residual
        assert abs(residual[w // 3]) > 5e-3


@pytest.mark.parametrize(
    ("wire", "change", "message"),
    [
        (1, 0.3e-3, "module 1: no posture has its wire lengths.*nearest"),
        (4, 20e-3, "wire 4 of module 2: length .* no posture is outside"),
        (7, math.nan, "wire 7 of module 3"),
    ],
)
def test_lengths_no_posture_has_are_refused(wire, change, message):
    L = lengths_of(random_bends(1, seed=4)[0] * 0.5)
    assert np.isfinite(checked_angles(L, PARAMS)).all()
    L[wire] += change
    with pytest.raises(ValueError, match=message):
        checked_angles(L, PARAMS)


def test_a_bend_beyond_its_limit_is_refused():
    q = np.zeros(7)
    q[2] = 0.83
    with pytest.raises(ValueError, match=r"wire \d of module 1|beyond max_bend"):
        checked_angles(lengths_of(q), PARAMS)
    q[1:3] = 0.2, 0.79  # no wire at this azimuth is at the end of its own range
    with pytest.raises(ValueError, match=r"beyond max_bend=0\.7854"):
        checked_angles(lengths_of(q), PARAMS)
