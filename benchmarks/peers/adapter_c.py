# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""C: the textbook closed form, compiled, with the scalar functions of libm."""

import ctypes
import shutil
import subprocess
import tempfile

import numpy as np
from contract import Peer
from plain import compiled, constants


class Adapter(Peer):
    """Calls plain.c through ctypes."""

    name = 'C, scalar libm'
    flags = ()
    how = (
        'The textbook closed form (benchmarks/peers/plain.c) is compiled with cc -O3 as a loop '
        'over an array.'
    )

    def __init__(self, mechanism, speed, first):
        super().__init__(mechanism, speed, first)
        if not shutil.which('cc'):
            raise ImportError('there is no C compiler cc')
        numbers = np.ctypeslib.ndpointer(float)
        with tempfile.TemporaryDirectory() as folder:
            library = self.built(folder)
            self.function = ctypes.CDLL(str(library)).four_bar
        self.function.restype = None
        self.function.argtypes = [ctypes.c_long, numbers, numbers, ctypes.c_double, numbers]
        self.constants = np.array(constants(mechanism, self.side))

    def built(self, folder):
        """Compiles the library; returns its path."""
        return compiled(folder, *self.flags)

    def torque_array(self, angles):
        out = self.rows(10, angles.size)
        self.function(angles.size, self.constants, angles, self.speed, out)
        return out

    def table(self, results):
        return results[[1, 2, 4, 5, 7, 8, 9]]


class VectorAdapter(Adapter):
    """Calls the same source, compiled to use vector functions."""

    name = 'C, vector math'
    # Otherwise GCC fuses sine and cosine into sincos, which has no vector function.
    flags = ('-ffast-math', '-march=native', '-fdisable-tree-sincos')
    how = (
        'The same file is compiled with -ffast-math -march=native and libmvec, without the '
        'compiler pass that fuses sine and cosine, of which libmvec has no vector form.'
    )

    def built(self, folder):
        flags = (*self.flags, '-Wl,--no-as-needed', '-lmvec')
        try:
            library = compiled(folder, *flags)
        except RuntimeError as error:
            raise ImportError('cc does not know these flags, or there is no libmvec') from error
        symbols = subprocess.run(
            ['nm', '-D', library], check=True, capture_output=True, text=True
        ).stdout
        for function in ('v_sin', 'v_cos', 'vv_atan2'):
            if '_ZGV' not in symbols or function not in symbols:
                raise ImportError(f'cc made no call of the vector function {function}')
        return library
