"""Import pybullet without the build time that it prints in every process."""

import os
import sys

if "pybullet" not in sys.modules:
    # C code prints the line, past `sys.stderr`: only redirecting the file descriptor hides it.
    sys.stderr.flush()
    _stderr = os.dup(2)
    _devnull = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(_devnull, 2)
        import pybullet
    except ImportError as error:
        hint = "the engine bullet needs pybullet, which is there for Python 3.11 only: pip install 'torchvsa[sim]'"
        raise ImportError(hint, name="pybullet") from error
    finally:
        os.dup2(_stderr, 2)
        os.close(_devnull)
        os.close(_stderr)

import pybullet

__all__ = ["pybullet"]
