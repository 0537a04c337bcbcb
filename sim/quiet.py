"""Import pybullet without the build time that it prints for every process."""

import os
import sys

if "pybullet" not in sys.modules:
    sys.stderr.flush()
    _kept = os.dup(2)
    _nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(_nowhere, 2)  # it is printed by C code, past sys.stderr
        import pybullet as _pybullet
    finally:
        os.dup2(_kept, 2)
        os.close(_nowhere)
        os.close(_kept)
    del _pybullet
