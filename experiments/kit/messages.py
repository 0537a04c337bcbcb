"""Errors of Hydra and OmegaConf in one line that names the setting, its value and what is allowed."""

from __future__ import annotations

import difflib
import re
from concurrent.futures import BrokenExecutor

from omegaconf.errors import ConfigAttributeError, ConfigKeyError, OmegaConfBaseException, ValidationError

KINDS = {"Integer": "a whole number", "Float": "a number", "bool": "true or false", "String": "a text"}


def in_words(error: BaseException) -> str:
    """What went wrong, in one line."""
    cause: BaseException | None = error
    while cause is not None:
        if isinstance(cause, OmegaConfBaseException):
            return _of_omegaconf(cause)
        cause = cause.__cause__
    text = " ".join(str(error).split())
    if of_cluster(error) and "timed-out" in text:
        return "a job reached its time limit, hydra.launcher.timeout_min; the same command goes on from here"
    if isinstance(error, BrokenExecutor):
        codes = re.search(r"exit codes of the workers are (\{.*?\})", text)
        how = f" ({codes[1].strip('{}')})" if codes else ""
        return f"a worker process died{how}, perhaps for lack of memory; the same command goes on from here"
    if found := re.search(
        r"Could not find '([\w/]+)/([^'/]*)' Available options in '[\w/]+': (.*?) Config search", text
    ):
        group, option, options = found.groups()
        return f"there is no {group} {option!r}; choose from {', '.join(options.split())}"
    if found := re.search(r"Could not find 'experiment/([^']+)'", text):
        return f"there is no experiment {found[1]!r}; this study has no presets"
    if found := re.search(
        r"Could not override '(.*?)'\. No match in the defaults|raised while .*: Key '(.*?)' not in", text
    ):
        return f"there is no setting {found[1] or found[2]!r}; --help lists those of this study"
    if found := re.search(r"Ambiguous value for argument '(.*?)=(.*?)' 1\.", text):
        return f"{found[1]}={found[2]}: a list needs brackets, {found[1]}=[{found[2]}]; a job for each needs --multirun"
    if found := re.search(r"Error parsing override '(.*?)' (.*?) See https", text):
        return f"{found[1]}: write setting=value; {found[2]}"
    if found := re.search(r"Multiple values for (\w+)\.", text):
        return f"write {found[1]}=... without +"
    return text or type(error).__name__


def of_cluster(error: BaseException) -> bool:
    """Whether submitit, Dask or joblib tell what became of a job or a worker."""
    return type(error).__module__.partition(".")[0] in ("submitit", "distributed", "joblib")


def _of_omegaconf(error: OmegaConfBaseException) -> str:
    key, text = error.full_key or "", " ".join(str(error).split())
    if isinstance(error, ConfigKeyError | ConfigAttributeError):
        if key == "experiment":
            return "this study has no presets, so that there is no experiment to choose"
        parent, _, name = key.rpartition(".")
        known = [] if error.parent_node is None else [str(one) for one in error.parent_node if one != "hydra"]  # pyright: ignore[reportGeneralTypeIssues] (a container)
        near = difflib.get_close_matches(name, known, 1)
        hint = f"did you mean {parent}.{near[0]}?".replace(" .", " ") if near else f"choose from {', '.join(known)}"
        return f"there is no setting {key!r}; {hint}"
    if isinstance(error, ValidationError):
        if "Invalid type assigned: NoneType" in text:
            return f"{key}=null: expected a value"
        if found := re.search(r"Invalid type assigned: .* value: (.*?) full_key", text):
            return f"{key}={found[1]}: it holds settings; write {key}.setting=value"
        if "ListConfig" in text:
            return f"{key}: expected a list, e.g. {key}=[a,b]" if key else "expected lists in a list, e.g. [[1],[1,2]]"
        if found := re.search(
            r"Value '(.*?)' (?:(?:of type '.*?' )?could not be converted to (\w+)|is not a valid (\w+))", text
        ):
            return f"{key}={found[1]}: expected {KINDS.get(found[2] or found[3], found[2] or found[3])}"
        if found := re.search(r"Cannot convert '\w+' to string: '(.*?)' full_key", text):
            return f"{key}={found[1]}: expected a text"
        if "is not Optional" in text:
            return f"{key}=null: expected a value"
    text = text.partition(" full_key:")[0]
    if re.match(r"Cannot (assign \w+ to Dict|merge DictConfig with)", text):
        return f"{key}: it holds settings; write {key}.setting=value"
    return text if not key or key in text else f"{key}: {text}"
