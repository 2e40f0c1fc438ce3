"""The entry to the compiled kernel, used once per wake-up of the medium: one argument in place of sixteen.

At every call numba determines type, address and shape of each array argument, which takes longer than the kernel needs
for a frame. So a table holds the addresses, and the arrays are put together inside. Without compilation there is no
table.
"""

from collections.abc import Callable
from functools import partial
from typing import Any, Final, cast

import numpy as np
import numpy.typing as npt

from emulator.kernel.jit import COMPILED, jit_views
from emulator.kernel.kernel import advance
from emulator.kernel.state import Ints

_ARRAYS: Final = 16
Array = npt.NDArray[np.int64] | npt.NDArray[np.float64]


class KernelEntry:
    """`kernel.advance` bound to these arrays, given in its order. When an array is replaced, a new entry is needed."""

    def __init__(self, *arrays: Array) -> None:
        self._arrays = arrays  # holds a reference to each array: the table of addresses does not
        self.advance: Callable[[int], int]
        """Takes the instant until which to advance; returns what `kernel.advance` returns."""
        if COMPILED:
            assert len(arrays) == _ARRAYS, "as many as the kernel takes"
            assert all(a.flags.c_contiguous for a in arrays), "inside they are taken for whole rows"
            self._table = np.array([(a.ctypes.data, a.shape[0], a.shape[-1]) for a in arrays], np.int64)
            self.advance = partial(advance_at, self._table.ctypes.data)
        else:
            self.advance = partial(cast("Callable[..., int]", advance), *arrays)


if COMPILED:
    from numba import carray
    from numba.core.types import CPointer  # type: ignore[attr-defined]
    from numba.extending import intrinsic

    @intrinsic  # type: ignore[untyped-decorator]
    def pointer(_: Any, address: Any, dtype: Any) -> Any:
        """The address as a pointer to numbers of the given type."""

        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            return builder.inttoptr(arguments[0], context.get_value_type(signature.return_type))

        return CPointer(dtype.dtype)(address, dtype), generate

    @jit_views
    def line(table: Ints, i: int, dtype: Any) -> Any:
        return carray(pointer(table[i, 0], dtype), (table[i, 1],))

    @jit_views
    def rows(table: Ints, i: int, dtype: Any) -> Any:
        return carray(pointer(table[i, 0], dtype), (table[i, 1], table[i, 2]))

    @jit_views
    def advance_at(address: int, until: int) -> int:
        """`kernel.advance` on the arrays that the table at this address describes."""
        ints, reals = np.int64, np.float64
        table = carray(pointer(address, ints), (_ARRAYS, 3))
        return advance(
            line(table, 0, ints), line(table, 1, ints), line(table, 2, reals), rows(table, 3, ints),
            rows(table, 4, reals), rows(table, 5, ints), rows(table, 6, ints), rows(table, 7, reals),
            line(table, 8, ints), rows(table, 9, reals), rows(table, 10, reals), rows(table, 11, ints),
            rows(table, 12, ints), rows(table, 13, ints), rows(table, 14, ints), rows(table, 15, reals), until,
        )  # fmt: skip
