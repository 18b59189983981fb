"""How the kernel's functions are compiled, and how its arrays come to it."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit, types
from numba.extending import intrinsic
from numba.np import arrayobj

from handfast.stability.search.arrays import LINE

NUMBERS = {"f": types.float64, "i": types.int64, "b": types.boolean}  # as `arrays.KINDS`


def inner(function: Any) -> Any:
    """Compiled, for compiled callers only."""
    return njit(nogil=True, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)(function)


def quick(function: Any) -> Any:
    """The same, sums in any order: for what is checked afterwards."""
    options = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True, "fastmath": {"reassoc", "contract"}}
    return njit(nogil=True, error_model="numpy", **options)(function)


@quick
def larger(a, b):  # type: ignore[no-untyped-def]
    """Of two numbers; `max` is a call that is not inlined."""
    return a if a > b else b


@quick
def smaller(a, b):  # type: ignore[no-untyped-def]
    return a if a < b else b


@quick
def length(x, y):  # type: ignore[no-untyped-def]
    """Of a vector in the plane."""
    return np.sqrt(x * x + y * y)


@intrinsic(prefer_literal=True)
def views(typing, table, layout):  # type: ignore[no-untyped-def]
    """The arrays of an `arrays.table`, a tuple; they have no owners."""
    kinds = [types.Array(NUMBERS[kind[0]], int(kind[1]), "C") for kind in layout.literal_value.split()]
    result = types.Tuple(kinds)

    def code(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        made = []
        for k, kind in enumerate(kinds):
            places = [context.get_constant(types.intp, LINE * k + i) for i in range(1 + kind.ndim)]
            address, *shape = (builder.load(builder.gep(arguments[0], [place])) for place in places)
            size = context.get_constant(types.intp, context.get_abi_sizeof(context.get_data_type(kind.dtype)))
            strides = [size]
            for length in shape[:0:-1]:
                strides.insert(0, builder.mul(strides[0], length))
            view = context.make_array(kind)(context, builder)
            data = builder.inttoptr(address, view.data.type)
            arrayobj.populate_array(view, data, shape, strides, size, None)
            made.append(view._getvalue())
        return context.make_tuple(builder, result, made)

    return result(table, layout), code
