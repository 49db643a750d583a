"""A small fuzzy engine: variables, a rule table as data, weighted average.

A rule table is a list of rows of labels, as papers print it: cell [i][j] is
the conclusion of "row variable is its i-th label and column variable is its
j-th label". AND is the minimum, rules of equal conclusion are joined by the
maximum, and a conclusion is a number or a vector (zero-order Sugeno): the
result is the mean of the conclusions weighted by their degrees. That is what
a Mamdani inference gives for narrow output sets of equal width.
"""

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from math import cos, pi

import numpy as np

from systems.common.compiled import compiled

type Membership = Callable[[float], float]


def triangle(a: float, b: float, c: float) -> Membership:
    """Rises from a to 1 at b and falls to zero at c; a <= b <= c."""
    return trapezoid(a, b, b, c)


def trapezoid(a: float, b: float, c: float, d: float) -> Membership:
    """Rises from a to 1 at b, stays, falls from c to zero at d.

    An infinite `a` and `b` (or `c` and `d`) make an open shoulder.

    Raises:
        ValueError: If not a <= b <= c <= d.
    """
    if not a <= b <= c <= d:
        raise ValueError(f"trapezoid({a}, {b}, {c}, {d}): expected a <= b <= c <= d")

    def degree(x: float) -> float:
        if b <= x <= c:
            return 1.0
        if a < x < b:
            return (x - a) / (b - a)
        if c < x < d:
            return (d - x) / (d - c)
        return 0.0

    return degree


def cosine(center: float, half_width: float) -> Membership:
    """A smooth hump, cos^2: 1 at the center, 0 from `half_width` away.

    Neighbours one half width apart sum to 1.

    Raises:
        ValueError: If the half width is not positive.
    """
    if not half_width > 0.0:
        raise ValueError(f"cosine: half_width={half_width} must be > 0")

    def degree(x: float) -> float:
        z = abs(x - center) / half_width
        return 0.5 + 0.5 * cos(pi * z) if z < 1.0 else 0.0

    return degree


class Variable:
    """A linguistic variable: labels and their membership functions.

    Attributes:
        labels: The labels' names, in order.
    """

    def __init__(self, sets: Mapping[str, Membership]) -> None:
        self.labels = list(sets)
        self._memberships = list(sets.values())

    def degrees(self, x: float) -> list[float]:
        """Membership of x in every label, in the labels' order."""
        return [membership(x) for membership in self._memberships]


class Partition:
    """A variable of triangles over increasing centers, open shoulders outside.

    The memberships of any x sum to 1, and at most two are positive.

    Attributes:
        labels: The labels' names, in order.
        centers: Where each label's membership is 1.
    """

    def __init__(self, labels: Sequence[str], centers: Sequence[float]) -> None:
        """Takes labels and centers.

        Raises:
            ValueError: If the centers do not increase or do not match the labels.
        """
        if len(labels) != len(centers):
            raise ValueError(
                f"{len(centers)} centers {list(centers)} for {len(labels)} labels "
                f"{list(labels)}"
            )
        if not all(a < b for a, b in pairwise(centers)):
            raise ValueError(f"centers {list(centers)} must increase")
        self.labels = list(labels)
        self.centers = list(centers)

    def degrees(self, x: float) -> list[float]:
        """Membership of x in every label, in the labels' order."""
        return degrees(np.array(self.centers, float), float(x)).tolist()


class RuleTable:
    """Two antecedents, a table of conclusions, and what the conclusions mean.

    Attributes:
        conclusions: The conclusions' labels, in the order of `activations`.
        cells: Index of each cell's conclusion (rows x columns).
        values: The conclusions' vectors, one a row.
    """

    def __init__(
        self,
        table: Sequence[Sequence[str]],
        values: Mapping[str, Sequence[float]],
    ) -> None:
        """Takes the table's cells and the conclusions' values.

        Args:
            table: One row per label of the row variable, one column per label
                of the column variable; each cell a conclusion's label.
            values: The conclusions' vectors by label, all of one length.

        Raises:
            ValueError: If the rows differ in length, a cell has no value or the
                values differ in length.
        """
        if len({len(row) for row in table}) != 1:
            raise ValueError(f"rows of unequal length in {table}")
        unknown = {cell for row in table for cell in row} - set(values)
        if unknown:
            raise ValueError(
                f"no value for {sorted(unknown)}; values are there for {list(values)}"
            )
        if len({len(value) for value in values.values()}) != 1:
            raise ValueError(f"values of unequal length in {dict(values)}")
        self.conclusions = list(values)
        index = {label: i for i, label in enumerate(self.conclusions)}
        self.cells = np.array([[index[cell] for cell in row] for row in table])
        self.values = np.array(list(values.values()), float)

    def activations(
        self, rows: Sequence[float], columns: Sequence[float]
    ) -> list[float]:
        """The degree of every conclusion, from the antecedents' degrees."""
        row_array, column_array = np.array(rows, float), np.array(columns, float)
        count = len(self.conclusions)
        return activations(self.cells, count, row_array, column_array).tolist()

    def infer(self, rows: Sequence[float], columns: Sequence[float]) -> list[float]:
        """Mean of the conclusions' values, weighted by their degrees.

        Raises:
            ValueError: If no rule fires.
        """
        degree = self.activations(rows, columns)
        return weighted_mean(np.array(degree), self.values).tolist()


@compiled
def degrees(centers: np.ndarray, x: float) -> np.ndarray:
    """Membership of x in the triangles over increasing centers, see `Partition`."""
    result = np.zeros(len(centers))
    i = np.searchsorted(centers, x, side="right")
    if i == 0:
        result[0] = 1.0
    elif i == len(centers):
        result[-1] = 1.0
    else:
        share = (x - centers[i - 1]) / (centers[i] - centers[i - 1])
        result[i - 1] = 1.0 - share
        result[i] = share
    return result


@compiled
def activations(
    cells: np.ndarray, count: int, rows: np.ndarray, columns: np.ndarray
) -> np.ndarray:
    """The degree of each of `count` conclusions: maximum over rules of the minimum.

    Args:
        cells: Index of each rule's conclusion (rows x columns).
        count: Number of conclusions.
        rows: Degrees of the row variable.
        columns: Degrees of the column variable.
    """
    result = np.zeros(count)
    for i in range(len(rows)):
        for j in range(len(columns)):
            rule = cells[i, j]
            result[rule] = max(result[rule], min(rows[i], columns[j]))
    return result


@compiled
def weighted_mean(degree: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Mean of the rows of `values`, weighted by `degree`.

    Raises:
        ValueError: If all degrees are zero.
    """
    total = degree.sum()
    if not total > 0.0:
        raise ValueError("no rule fires: the memberships leave a gap")
    result = np.zeros(values.shape[1])
    for i in range(len(degree)):
        result += degree[i] / total * values[i]
    return result
