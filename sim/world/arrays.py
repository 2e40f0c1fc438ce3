"""Names of the arrays in which the world keeps what it knows of all nodes."""

import numpy as np
import numpy.typing as npt

Rows = npt.NDArray[np.float64]
"""One row for each node, with east, north and up: float64 [nodes, 3]."""
Values = npt.NDArray[np.float64]
"""float64 of any shape."""
Flags = npt.NDArray[np.bool_]
