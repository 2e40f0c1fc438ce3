"""The assignment problem: each of n rows gets a column of its own so that the sum of the costs is least.

The Hungarian method in the form of shortest augmenting paths (Jonker and Volgenant, Computing 38, 1987), O(n^2 m).
"""

import math
from collections.abc import Sequence


def assign(costs: Sequence[Sequence[float]]) -> list[int]:
    """The column of each row, of no more rows than columns; of equal assignments the one with lower columns."""
    rows = len(costs)
    columns = len(costs[0]) if rows else 0
    assert columns >= rows, "every row needs a column"
    row_price, column_price = [0.0] * (rows + 1), [0.0] * (columns + 1)
    row_of = [0] * (columns + 1)
    """The row of each column, counted from 1; 0 for none. Column 0 stands for the row that is being placed."""
    came_from = [0] * (columns + 1)
    for row in range(1, rows + 1):
        row_of[0] = row
        column = 0
        least, used = [math.inf] * (columns + 1), [False] * (columns + 1)
        while row_of[column]:
            used[column] = True
            at, step, following = row_of[column], math.inf, 0
            for j in range(1, columns + 1):
                if used[j]:
                    continue
                reduced = costs[at - 1][j - 1] - row_price[at] - column_price[j]
                if reduced < least[j]:
                    least[j], came_from[j] = reduced, column
                if least[j] < step:
                    step, following = least[j], j
            for j in range(columns + 1):
                if used[j]:
                    row_price[row_of[j]] += step
                    column_price[j] -= step
                else:
                    least[j] -= step
            column = following
        while column:
            row_of[column] = row_of[came_from[column]]
            column = came_from[column]
    result = [0] * rows
    for column in range(1, columns + 1):
        if row_of[column]:
            result[row_of[column] - 1] = column - 1
    return result
