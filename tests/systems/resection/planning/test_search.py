"""A search that is cut off goes on as if it had not been."""

import numpy as np
import pytest

from systems.resection.planning.draws import new_draws
from systems.resection.planning.procedure import Procedure
from systems.resection.planning.search import Search, load_search, save_search
from tests.ball import ball_session

ENTRY = Procedure("entry", length=0.016, radius=0.005, pitch=1e-3, name="entry")


def begun():
    session = ball_session()
    assert session.commit(ENTRY).feasible
    return Search(session.thought(), new_draws(3), 0.02)


def test_a_search_cut_off_ends_with_the_same():
    whole, cut = begun(), begun()
    while not whole.ended:
        whole.step()
    cut.step()
    cut.step()
    told = {name: array.copy() for name, array in cut.arrays().items()}
    again = begun()
    again.resume(told)
    assert again.share == cut.share > 0.0
    while not again.ended:
        again.step()
    assert again.gone == whole.gone and len(whole.gone) > 4
    for name, array in whole.arrays().items():
        np.testing.assert_array_equal(array, again.arrays()[name], name)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("parent", 10**6, "parent: expected a node before"),
        ("wanted", -5, "wanted: expected from 0"),
        ("home", 10**6, "home"),
        ("gone", -1, "gone: expected from 0"),
        ("x", np.nan, "not finite"),
    ],
)
def test_what_makes_no_sense_is_refused(name, value, message):
    search = begun()
    told = {key: array.copy() for key, array in search.arrays().items()}
    told[name].reshape(-1)[-1] = value
    with pytest.raises(ValueError, match=message):
        search.resume(told)


def test_a_file_of_another_search_is_not_gone_on_from(tmp_path):
    first = begun()
    first.step()
    save_search(tmp_path / "search", first, "mine")
    again = begun()
    with pytest.raises(ValueError, match="of another tumour, robot, seed or effort"):
        load_search(tmp_path / "search", again, "yours")
    load_search(tmp_path / "search", again, "mine")
    assert again.gone == first.gone
