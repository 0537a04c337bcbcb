"""Errors of Hydra and OmegaConf in one line that names the setting, its value and what is allowed."""

from __future__ import annotations

import difflib
import re

from hydra.errors import HydraException
from omegaconf.errors import ConfigAttributeError, ConfigKeyError, OmegaConfBaseException, ValidationError

KINDS = {"Integer": "a whole number", "Float": "a number", "Boolean": "true or false", "String": "a text"}
WRONG_TYPE = re.compile(r"Value '(.*?)'(?: of type .*)? could .* converted to (\w+)")


def in_words(error: BaseException) -> str:
    """What went wrong, in one line."""
    cause: BaseException | None = error
    while cause is not None:
        if isinstance(cause, OmegaConfBaseException):
            return _of_omegaconf(cause)
        cause = cause.__cause__
    text = " ".join(str(error).split())
    if isinstance(error, HydraException):
        text = text.replace(" To append to your config use +", "; to add it, write +")
    return text or type(error).__name__


def _of_omegaconf(error: OmegaConfBaseException) -> str:
    key = error.full_key or ""
    if isinstance(error, ConfigKeyError | ConfigAttributeError):
        known = [str(name) for name in error.parent_node or ()] if error.parent_node is not None else []  # pyright: ignore[reportGeneralTypeIssues]
        near = difflib.get_close_matches(str(error.key), known, 1)
        hint = f"did you mean {near[0]}?" if near else f"choose from {', '.join(known)}"
        return f"there is no setting {key!r}; {hint}"
    if isinstance(error, ValidationError) and (found := WRONG_TYPE.search(str(error))):
        return f"{key}={found[1]}: expected {KINDS.get(found[2], found[2])}"
    if isinstance(error, ValidationError) and "ListConfig" in str(error):
        return f"{key}: expected a list, e.g. {key}=[a,b]"
    return f"{key}: {' '.join(str(error.msg or error).split())}" if key else " ".join(str(error).split())
