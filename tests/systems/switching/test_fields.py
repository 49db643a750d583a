"""Fields are gradients of their potentials, and what the thesis says of them."""

from math import hypot, pi

import numpy as np
import pytest

from systems.switching import fields

POINTS = np.random.default_rng(1).uniform(-3.0, 3.0, (60, 2)).tolist()
STEP = 1e-6


def minus_gradient(potential, x, y):
    """Central differences."""
    return (
        -(potential(x + STEP, y) - potential(x - STEP, y)) / (2.0 * STEP),
        -(potential(x, y + STEP) - potential(x, y - STEP)) / (2.0 * STEP),
    )


@pytest.mark.parametrize("point", POINTS)
def test_fields_are_anti_gradients(point):
    x, y = point
    d = hypot(x, y)
    pairs = [
        (fields.attractive_potential, fields.attractive_field(x, y)),
        (
            lambda a, b: fields.repulsive_potential(hypot(a, b) - 0.01, 2.0, 0.7),
            fields.repulsive_field(x, y, 0.01, 2.0, 0.7),
        ),
        (
            lambda a, b: fields.printed_repulsive_potential(hypot(a, b), 5.0),
            fields.printed_repulsive_field(x, y, 5.0),
        ),
        (
            lambda a, b: fields.helicoid_potential(a, b, -1.3),
            fields.helicoid_field(x, y, -1.3),
        ),
    ]
    if d > 0.71:
        for side in (1.0, -1.0):
            pairs.append(
                (
                    lambda a, b, s=side: fields.involute_potential(a, b, 0.7, s),
                    fields.involute_field(x, y, 0.7, side),
                )
            )
    for potential, field in pairs:
        expected = minus_gradient(potential, x, y)
        assert field == pytest.approx(expected, rel=1e-5, abs=1e-5)


def test_repulsion_is_continuous_at_its_border_but_not_as_printed():
    inside, outside = 2.0 - 1e-9, 2.0 + 1e-9
    khatib = [fields.repulsive_field(x, 0.0, 0.0, 2.0)[0] for x in (inside, outside)]
    assert khatib == pytest.approx([0.0, 0.0], abs=1e-8)
    printed = [
        fields.printed_repulsive_field(x, 0.0, 2.0)[0] for x in (inside, outside)
    ]
    assert printed == pytest.approx([1.0 / (2.0 * 2.0**2), 0.0])


def test_helicoid_of_the_thesis():
    # Figure 9: centre [1, 1], c = 2; positive c is clockwise, size |c| / d.
    for x, y in POINTS:
        u, v = fields.helicoid_field(x, y, 2.0)
        assert hypot(u, v) == pytest.approx(2.0 / hypot(x, y))
        assert x * u + y * v == pytest.approx(0.0, abs=1e-9)  # concentric
        assert x * v - y * u < 0.0  # clockwise
        u, v = fields.helicoid_field(x, y, -2.0)
        assert x * v - y * u > 0.0


def test_helicoid_has_many_values():
    turn = np.linspace(0.0, 2.0 * pi, 4001)
    ring = np.array([fields.helicoid_field(np.cos(a), np.sin(a), 2.0) for a in turn])
    tangent = np.column_stack([-np.sin(turn), np.cos(turn)])
    circulation = np.trapezoid((ring * tangent).sum(axis=1), turn)
    assert circulation == pytest.approx(-2.0 * pi * 2.0)
    x, y, z = fields.helicoid_point(0.5, 3.0 * pi, 2.0)
    assert (x, z) == pytest.approx((-0.5, 6.0 * pi)) and abs(y) < 1e-12


def test_involute_is_the_helicoid_on_the_circle_and_a_unit_field_everywhere():
    rho = 0.7
    for angle in np.linspace(0.0, 6.0, 30):
        x, y = rho * np.cos(angle), rho * np.sin(angle)
        helicoid = fields.helicoid_field(x, y, -rho)  # counter-clockwise
        assert fields.involute_field(x, y, rho, 1.0) == pytest.approx(
            helicoid, abs=1e-7
        )
    for x, y in POINTS:
        for side in (1.0, -1.0):
            u, v = fields.involute_field(x, y, rho, side)
            assert hypot(u, v) == pytest.approx(1.0)
            assert side * (x * v - y * u) > 0.0
            if hypot(x, y) > rho:  # the straight way on touches the circle
                assert abs(x * v - y * u) == pytest.approx(rho)
            else:  # leads out
                assert x * u + y * v > 0.0
