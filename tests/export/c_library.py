"""Calls a compiled export in C."""

import ctypes

import numpy as np


def call(library: ctypes.CDLL, name: str, arguments: list[np.ndarray], size: int) -> np.ndarray:
    """The result (``size``,) of a function of CasADi's signature."""
    work = (ctypes.c_longlong * 4)()
    pointers = [ctypes.byref(work, 8 * place) for place in range(4)]
    assert getattr(library, f"{name}_work")(*pointers) == 0
    sz_arg, sz_res, sz_iw, sz_w = work
    result = np.zeros(size)
    double = ctypes.POINTER(ctypes.c_double)
    arg, res = (double * sz_arg)(), (double * sz_res)()
    for place, value in enumerate(arguments):
        arg[place] = value.ctypes.data_as(double)
    res[0] = result.ctypes.data_as(double)
    iw, w = (ctypes.c_longlong * max(sz_iw, 1))(), (ctypes.c_double * max(sz_w, 1))()
    assert getattr(library, name)(arg, res, iw, w, 0) == 0
    return result
