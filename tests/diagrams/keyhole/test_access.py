"""Access through a trocar: what is allowed, and that the best is ranked first."""

import numpy as np
import pytest

from diagrams.keyhole import access
from diagrams.keyhole.access import Way, draw, find_ways, table
from diagrams.studies import load_scenario


@pytest.fixture(scope="module")
def ways():
    scenario = load_scenario("keyhole_resect", ["operation.tumour.length=0.018"])
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(access, "RING", 2)
        patch.setattr(access, "ROWS", 1)
        patch.setattr(access, "PITCH", 0.08)
        patch.setattr(access, "EFFORT", 0.02)
        return find_ways(scenario)


def test_entries_lie_on_lines_through_the_trocar(ways):
    assert len(ways.entries) == 3 and len(ways.trocars) == 9
    for way in ways.entries:
        off = np.cross(way.p_WE - way.p_WG, way.direction)
        assert np.linalg.norm(off) < 1e-9
        assert way.reason or 0.3 < way.share < 1.0
    assert ways.entries[0].share is not None


def test_what_the_arm_does_not_allow_is_left_out_and_the_rest_ranked(ways):
    allowed = [way for way in ways.trocars if way.share is not None]
    refused = [way for way in ways.trocars if way.share is None]
    assert allowed and refused
    assert "the tube tilts too far" in {way.reason for way in refused}
    shares = [way.share for way in allowed]
    assert shares == sorted(shares, reverse=True)
    assert ways.trocars[: len(allowed)] == allowed


def test_table_and_picture(ways):
    text = table(ways)
    assert "--set entry.p_WE=" in text
    assert "tilts too far" in text
    assert len(draw(ways).axes) >= 3


def test_a_way_that_misses_is_told():
    way = Way(np.zeros(3), np.zeros(3), np.zeros(3), [], 0.1, 0.1, None, "it misses")
    assert "it misses" in table(access.Ways([way], []))
