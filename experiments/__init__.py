"""Reproducible studies, one file per question. The only place where robot and algebra meet."""

try:
    import hydra as _hydra

    import sim as _sim
except ImportError as error:
    raise ImportError(f"{error.name} is missing; the experiments need: pip install 'torchvsa[corral]'") from error

del _hydra, _sim
