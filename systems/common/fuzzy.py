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


def partition(labels: Sequence[str], centers: Sequence[float]) -> Variable:
    """Triangles over increasing centers, open shoulders outside; they sum to 1.

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
    low = [-float("inf"), *centers[:-1]]
    high = [*centers[1:], float("inf")]
    sets = {}
    for i, (label, center) in enumerate(zip(labels, centers, strict=True)):
        b = low[i] if i == 0 else center
        c = high[i] if i == len(centers) - 1 else center
        sets[label] = trapezoid(low[i], b, c, high[i])
    return Variable(sets)


class RuleTable:
    """Two antecedents and a table of conclusions.

    Attributes:
        table: Rows of conclusion labels, as printed.
    """

    def __init__(self, table: Sequence[Sequence[str]]) -> None:
        """Takes the table's cells.

        Args:
            table: One row per label of the row variable, one column per label
                of the column variable.

        Raises:
            ValueError: If the rows differ in length.
        """
        self.table = [list(row) for row in table]
        if len({len(row) for row in self.table}) != 1:
            raise ValueError(f"rows of unequal length in {self.table}")

    def activations(
        self, rows: Sequence[float], columns: Sequence[float]
    ) -> dict[str, float]:
        """The degree of every conclusion that fires at all."""
        result: dict[str, float] = {}
        for row, cells in zip(rows, self.table, strict=True):
            if row > 0.0:
                for column, label in zip(columns, cells, strict=True):
                    degree = row if row < column else column
                    if degree > result.get(label, 0.0):
                        result[label] = degree
        return result


def weighted_average(
    activations: Mapping[str, float], values: Mapping[str, Sequence[float]]
) -> list[float]:
    """Mean of the conclusions' values, weighted by their degrees.

    Args:
        activations: Degrees by label, at least one of them positive.
        values: The conclusions' vectors by label, all of one length.

    Raises:
        ValueError: If no rule fires.
    """
    total = sum(activations.values())
    if not total > 0.0:
        raise ValueError("no rule fires: the memberships leave a gap")
    weighted = [
        (degree / total, values[label]) for label, degree in activations.items()
    ]
    size = len(weighted[0][1])
    return [sum(w * value[i] for w, value in weighted) for i in range(size)]
