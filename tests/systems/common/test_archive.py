"""Arrays of a file are held against what they should be."""

import numpy as np
import pytest

from systems.common.archive import check_arrays

EXPECTED = {"x": ("f8", ("n", 3)), "parent": ("i4", ("n",))}


def arrays(**changed):
    good = {"x": np.zeros((4, 3)), "parent": np.zeros(4, np.int32)}
    return good | changed


def test_what_fits_is_taken():
    check_arrays(arrays(), EXPECTED)


@pytest.mark.parametrize(
    "changed",
    [
        {"x": np.zeros(4)},  # a dimension too few
        {"x": np.zeros((4, 3, 1))},
        {"x": np.zeros((4, 2))},
        {"x": np.zeros((5, 3))},  # not as many as of the other
        {"x": np.zeros((4, 3), np.float32)},
        {"x": np.full((4, 3), np.nan)},
        {"parent": np.zeros((4, 1), np.int32)},
    ],
)
def test_what_does_not_is_refused(changed):
    with pytest.raises(ValueError, match=next(iter(changed))):
        check_arrays(arrays(**changed), EXPECTED)
