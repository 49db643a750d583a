"""A small fuzzy engine: triangles, a rule table as data, weighted average.

A rule table is a list of rows of labels, as papers print it: cell i, j is
the conclusion of "row variable is its i-th label and column variable is its
j-th label". AND is the minimum, rules of equal conclusion are joined by the
maximum, and a conclusion is a number or a vector (zero-order Sugeno): the
result is the mean of the conclusions weighted by their degrees. That is what
a Mamdani inference gives for narrow output sets of equal width.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from systems.common.compiled import compiled


class RuleTable:
    """Two antecedents, a table of conclusions, and what the conclusions mean.

    Attributes:
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
        index = {label: i for i, label in enumerate(values)}
        self.cells = np.array([[index[cell] for cell in row] for row in table])
        self.values = np.array(list(values.values()), float)


@compiled
def degrees(centers: np.ndarray, x: float) -> np.ndarray:
    """Membership of x in the triangles over increasing centers.

    Open shoulders outside: the memberships of any x sum to 1, at most two are positive.
    """
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
