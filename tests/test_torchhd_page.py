"""docs/torch-hd.md has a row for everything that torch-hd offers, and its rows are true."""

import ast
import re
import warnings
from collections.abc import Iterator
from types import ModuleType
from typing import Any, NamedTuple

import pytest
import torch
import torchhd
from packages import ROOT
from torch import Tensor
from torch.testing import assert_close

PAGE = (ROOT / "docs" / "torch-hd.md").read_text()
NAMES, EXAMPLE = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
SECTIONS = dict(re.findall(r"^## [A-Z]\w+: `([\w.]+)`$(.*?)(?=^## )", PAGE, re.MULTILINE | re.DOTALL))
TABLES = {
    module: re.findall(r"^\| `([^`]+)` \|(?: `([^`]+)`)? \|(.*)\|$", text, re.MULTILINE)
    for module, text in SECTIONS.items()
}
"""The rows of the table about each module: torch-hd's code, ours, a note."""
MODULES: dict[str, Any] = {"torchhd": torchhd} | {
    f"torchhd.{name}": getattr(torchhd, name)
    for name in ("functional", "structures", "embeddings", "classifiers", "memory", "models")
}


class Row(NamedTuple):
    """A row of the page with what both sides compute."""

    code: str
    theirs: Any
    ours: Any
    note: str
    named: set[str]
    """torch-hd's names in this row; those of attributes with the class."""


def evaluated(code: str, names: dict[str, Any]) -> Any:
    """The value of an expression or an assignment; after a call that changes an object, what the object holds."""
    (statement,) = ast.parse(code).body
    if isinstance(statement, ast.Assign):
        exec(code, names)
        code = ast.unparse(statement.targets[0])
    value = eval(code, names)
    value = names[code.partition(".")[0]] if value is None else value
    return getattr(value, "value", getattr(value, "weight", value))


def named_in(code: str, names: dict[str, Any]) -> set[str]:
    nodes = list(ast.walk(ast.parse(code)))
    owned = [(node.value, node.attr) for node in nodes if isinstance(node, ast.Attribute)]
    attributes = {(names[owner.id], attribute) for owner, attribute in owned if isinstance(owner, ast.Name)}
    classes = {(owner if isinstance(owner, type) else type(owner), attribute) for owner, attribute in attributes}
    return {node.id for node in nodes if isinstance(node, ast.Name)} | {f"{c.__name__}.{name}" for c, name in classes}


def rows(module: str) -> Iterator[Row]:
    """The rows of one table, from top to bottom: a row may use what those above it assign."""
    ours: dict[str, Any] = {}
    exec(NAMES, ours)
    theirs = dict(ours)
    for name, value in ours.items():
        if isinstance(value, Tensor) and value.shape[-1] == ours["d"]:
            theirs[name] = value.clone().as_subclass(torchhd.HRRTensor if name == "hrr" else torchhd.MAPTensor)
    for source in (torchhd, MODULES[module]):
        theirs |= {name: getattr(source, name) for name in source.__all__}
    torch.manual_seed(0)
    for code, mine, note in TABLES[module]:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # `hard_quantize` is deprecated
            value = evaluated(code, theirs)
        named = named_in(code, theirs)
        yield Row(code, value, evaluated(mine, ours) if mine else None, note.strip(), named)


def plain(value: Any) -> Any:
    return value.detach().as_subclass(Tensor) if isinstance(value, Tensor) else value


def similarities(x: Tensor) -> Tensor:
    gram = (x @ x.mH).real
    return gram / (gram.diagonal()[:, None] * gram.diagonal()).sqrt()


def public(kind: type) -> set[str]:
    return {f"{kind.__name__}.{name}" for name in vars(kind) if not name.startswith("_")}


def offered(module: str) -> set[str]:
    """The names that torch-hd offers, by the table that has them."""
    if module == "torchhd.functional":
        found = {name for name in torchhd.__all__ if callable(getattr(torchhd, name))}
        return found.union(torchhd.functional.__all__) - offered("torchhd")
    if module == "torchhd":
        return {name for name in torchhd.__all__ if name == "__version__" or name.endswith("Tensor")}
    own = set(MODULES[module].__all__)
    return own.union(*(public(getattr(MODULES[module], name)) for name in own)) if "structures" in module else own


@pytest.mark.parametrize("module", MODULES)
def test_everything_that_torch_hd_offers_has_a_row_that_is_true(module: str) -> None:
    assert SECTIONS[module].count("\n| `") == len(TABLES[module]), "a row of this table cannot be read"
    missing = offered(module)
    for row in rows(module):
        missing -= row.named
        says_not = row.note.startswith("not here")
        assert says_not == (row.ours is None), f"{row.code}: neither code nor a reason, or both"
        if row.note.startswith("="):
            told = f"{row.code}: torch-hd computes {row.theirs}, the page {row.ours}"
            assert_close(plain(row.theirs), plain(row.ours), rtol=1e-3, atol=1e-4, check_dtype=False, msg=told)
        elif row.note.startswith("≈"):
            # Two draws, each with a standard deviation of about 1/√d.
            apart = (similarities(plain(row.theirs)) - similarities(plain(row.ours))).abs().max()
            assert apart < 5 * (2 / 2000) ** 0.5, f"{row.code} has other similarities, by {apart}"
    assert not missing, f"these have no row: {sorted(missing)}"


def test_its_modules_are_named() -> None:
    modules = {f"torchhd.{name}" for name in torchhd.__all__ if isinstance(getattr(torchhd, name), ModuleType)}
    assert modules <= set(re.findall(r"`(torchhd\.\w+)`", PAGE))
    assert set(TABLES) == set(MODULES)
    assert torchhd.__version__ in PAGE.split("##")[0]


@pytest.fixture(scope="module")
def example() -> dict[str, Any]:
    names: dict[str, Any] = {}
    exec(EXAMPLE.replace("print(", "accuracy = ("), names)
    return names


def test_the_example_predicts_what_torch_hd_predicts_with_the_same_codebooks(example: dict[str, Any]) -> None:
    train, test, shown, wanted = (example[name] for name in ("train", "test", "shown", "wanted"))
    peer = torchhd.classifiers.Vanilla(64, example["vsa"].dim, 10, n_levels=17, min_level=0)
    peer.keys.weight.data.copy_(example["encode"].roles)
    peer.levels.weight.data.copy_(example["encode"].codes)
    batches = list(zip(train.float().split(1), shown.split(1), strict=True))
    with torch.no_grad():
        peer.fit(batches)
        encoded = plain(peer.encoder(test[:20].float()))
        predicted = torch.cat([peer.predict(row) for row in test.float().split(1)])
    assert torch.equal(example["encode"](test[:20]).float(), encoded)
    assert torch.equal(example["centroids"], plain(peer.model.weight))
    assert torch.equal(example["predicted"], plain(predicted))
    assert example["accuracy"] == (predicted == wanted).double().mean().item()


@pytest.mark.parametrize("seed", [1, 2])
def test_the_example_is_as_accurate_with_other_codebooks(example: dict[str, Any], seed: int) -> None:
    again = {**example}
    exec(EXAMPLE.replace("print(", "accuracy = (").replace("seed=0)", f"seed={seed})"), again)
    assert not torch.equal(again["centroids"], example["centroids"])
    # Three standard deviations of the share of 450 digits that are recognised, of about 9 in 10.
    assert again["accuracy"] == pytest.approx(0.91, abs=0.04)
    assert example["accuracy"] == pytest.approx(0.91, abs=0.04)
