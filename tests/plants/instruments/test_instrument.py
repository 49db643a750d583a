"""The instrument, and what the wrist sensor feels."""

import math

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    ForceElementIndex,
    JacobianWrtVariable,
    RevoluteSpring,
)
import pytest

from plants.instruments.instrument import InstrumentParams, add_instrument

WEIGHT = [0.0, 0.0, -9.81]


def test_tip_mass_and_centre():
    params = InstrumentParams(length=0.35, gauze_mass=0.02)
    plant = MultibodyPlant(time_step=0.0)
    instrument = add_instrument(plant, plant.world_frame(), params)
    plant.Finalize()
    context = plant.CreateDefaultContext()
    X_WT = instrument.tip.CalcPoseInWorld(context)
    np.testing.assert_allclose(X_WT.translation(), [0, 0, 0.35])
    inertia = instrument.body.default_spatial_inertia()
    assert inertia.get_mass() == pytest.approx(0.16 + 0.04 + 0.02)
    assert params.mass == pytest.approx(inertia.get_mass())
    centre = (0.16 * 0.03 + 0.04 * 0.175 + 0.02 * 0.35) / 0.22
    assert params.centre == pytest.approx(centre)
    np.testing.assert_allclose(inertia.get_com(), [0, 0, centre], atol=1e-12)
    assert instrument.shaft_geometry is None  # no SceneGraph here


def test_a_shaft_that_bends_gives_way_as_a_beam_and_weighs_the_same():
    params = InstrumentParams(bending_stiffness=5.3, gauze_mass=0.02)
    plant = MultibodyPlant(time_step=0.0)
    tool = add_instrument(plant, plant.world_frame(), params)
    plant.Finalize()
    context, world = plant.CreateDefaultContext(), plant.world_frame()
    assert plant.CalcTotalMass(context) == pytest.approx(params.mass)
    centre = plant.CalcCenterOfMassPositionInWorld(context)
    np.testing.assert_allclose(centre, [0, 0, params.centre], atol=3e-4)
    J = plant.CalcJacobianSpatialVelocity(
        context, JacobianWrtVariable.kV, tool.tip, np.zeros(3), world, world
    )
    elements = map(ForceElementIndex, range(plant.num_force_elements()))
    springs = [plant.get_force_element(i) for i in elements]
    k = [s.GetStiffness(context) for s in springs if isinstance(s, RevoluteSpring)]
    long, force = params.length - params.mount_length, np.array([0.8, -0.6, 0.0])
    turn, way = np.split(J @ (J[3:].T @ force / k), 2)
    np.testing.assert_allclose(way, force * long**3 / (3 * 5.3), rtol=1e-9)
    assert np.linalg.norm(turn) == pytest.approx(long**2 / (2 * 5.3))


@pytest.mark.parametrize("gauze", [0.0, 0.02])
def test_sensor_carries_the_instruments_weight_at_rest(make_scene, gauze):
    params = InstrumentParams(gauze_mass=gauze)
    scene = make_scene(p_WP=(0.05, 0.03, -0.1), instrument_params=params)
    scene.simulator.AdvanceTo(1.0)
    R_WM = scene.instrument.body.EvalPoseInWorld(scene.context).rotation()
    reaction = scene.reaction()
    weight = params.mass * np.array(WEIGHT)
    np.testing.assert_allclose(R_WM @ reaction.translational(), -weight, atol=0.01)
    centre = R_WM @ [0.0, 0.0, params.centre]
    moment = -np.cross(centre, weight)
    np.testing.assert_allclose(R_WM @ reaction.rotational(), moment, atol=0.003)


@pytest.mark.parametrize(
    ("params", "message"),
    [
        (InstrumentParams(length=0.5), "instrument.length=0.5 m: .*<= 0.45"),
        (InstrumentParams(diameter=0.02), "instrument.diameter=0.02 m: expected"),
        (InstrumentParams(gauze_mass=-1.0), "instrument.gauze_mass=-1.0 kg: .*>= 0"),
        (InstrumentParams(mount_mass=math.nan), "instrument.mount_mass=nan"),
    ],
)
def test_impossible_parameters_are_refused(params, message):
    plant = MultibodyPlant(time_step=0.0)
    with pytest.raises(ValueError, match=message):
        add_instrument(plant, plant.world_frame(), params)
