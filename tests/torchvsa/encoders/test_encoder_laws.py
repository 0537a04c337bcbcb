"""Every listed encoder keeps the laws in every architecture: one that joins the registry needs an example here."""

from collections.abc import Callable, Iterator
from typing import Any, cast

import pytest
import torch
from readings import rows

import torchvsa
from torchvsa import VSA
from torchvsa.encoders import (
    ENCODERS,
    VALUE_ENCODERS,
    Balanced,
    Circular,
    Concatenated,
    Encoder,
    FractionalPower,
    History,
    Level,
    Lookup,
    Mirrored,
    ObliqueFeatures,
    Product,
    RandomFourier,
    SubsetProduct,
    Sum,
    Thermometer,
    ThresholdFeatures,
    ValueEncoder,
)
from torchvsa.testing import check_encoder, check_value_encoder


def _narrow(vsa: VSA, dim: int) -> VSA:
    return torchvsa.architecture(vsa.name, dim, vsa.dtype)


VALUES: dict[str, Callable[[VSA], ValueEncoder]] = {
    "lookup": lambda vsa: Lookup(vsa, 6),
    "level": lambda vsa: Level(vsa, 9, span=3),
    "balanced": lambda vsa: Balanced(vsa, 5),
    "thermometer": lambda vsa: Thermometer(vsa, 7),
    "circular": lambda vsa: Circular(vsa, 8),
    "fractional_power": lambda vsa: FractionalPower(vsa, 0.3, "sinc"),
}
ROWS: dict[str, Callable[[VSA], Encoder]] = {
    "sum": lambda vsa: Sum(Level(vsa, 8), 3),
    "product": lambda vsa: Product(Lookup(vsa, 5), 2),
    "subset_product": lambda vsa: SubsetProduct(Level(vsa, 8), 3, 2),
    "threshold_features": lambda vsa: ThresholdFeatures(vsa, 3, 9, 2),
    "oblique_features": lambda vsa: ObliqueFeatures(vsa, 3, 2),
    "random_fourier": lambda vsa: RandomFourier(vsa, 3),
    "concatenated": lambda vsa: Concatenated(
        [Sum(Level(_narrow(vsa, 24), 8), 3), Product(Lookup(_narrow(vsa, vsa.dim - 24), 4), 3)]
    ),
    "history": lambda vsa: History(Sum(Level(vsa, 8), 2), [1, 3]),
    "mirrored": lambda vsa: Mirrored(Level(vsa, 8), [(0, 2)], 4),
}
EDGES = [torch.tensor([0.25, 0.5]), torch.tensor([0.125, 0.125, 0.75])]
NONE = torch.tensor([])
MORE: dict[str, Callable[[VSA], Encoder]] = {
    "sum of mixed bins": lambda vsa: Sum([Level(vsa, 8), Circular(vsa, 6), Lookup(vsa, 3)]),
    "subset product of mixed bins": lambda vsa: SubsetProduct([Level(vsa, 8), Circular(vsa, 6), Lookup(vsa, 3)]),
    "mirrored of mixed bins": lambda vsa: Mirrored([Level(vsa, 8), Level(vsa, 8), Lookup(vsa, 3)], [(0, 1)]),
    "mirrored powers": lambda vsa: Mirrored(FractionalPower(vsa), [(0, 1)], 3),
    "product of powers": lambda vsa: Product(FractionalPower(vsa), 2),
    "sum of powers and bins": lambda vsa: Sum([FractionalPower(vsa), Level(vsa, 8)]),
    "waves": lambda vsa: RandomFourier(vsa, 2, sign=False),
    "edges": lambda vsa: ThresholdFeatures(vsa, 2, 9, edges=EDGES),
    "kinds": lambda vsa: ThresholdFeatures(vsa, 4, 8, 2, kinds=["real", "angle", 3, 2]),
    "kinds and edges": lambda vsa: ThresholdFeatures(
        vsa, 3, 8, edges=[EDGES[0], NONE, NONE], kinds=["real", "angle", 5]
    ),
    "history of kinds": lambda vsa: History(ThresholdFeatures(vsa, 2, 8, kinds=["angle", 4]), [1]),
    "held history": lambda vsa: History(Product(Level(vsa, 8), 2), [1, 2], hold=True),
    "held present": lambda vsa: History(Sum(Lookup(vsa, 4), 2), [], hold=True),
    "history of powers": lambda vsa: History(Sum(FractionalPower(vsa), 2), [2]),
    "oblique of rows": lambda vsa: ObliqueFeatures(vsa, 2, rows=torch.arange(18).reshape(9, 2) / 20),
    "boxes beside sums": lambda vsa: Concatenated(
        [ThresholdFeatures(_narrow(vsa, 30), 2, 9, edges=EDGES), ObliqueFeatures(_narrow(vsa, vsa.dim - 30), 2)]
    ),
    "history of sums": lambda vsa: History(ObliqueFeatures(vsa, 2), [1]),
    "history of edges": lambda vsa: History(ThresholdFeatures(vsa, 2, 9, edges=EDGES), [1]),
}
POWERS = ("fractional_power", "mirrored powers", "product of powers", "sum of powers and bins", "history of powers")
NEGATIVES = (
    *("balanced", "thermometer", "circular", "threshold_features", "sum of mixed bins", "edges", "kinds"),
    *("oblique_features", "oblique of rows", "history of sums"),
    *("kinds and edges", "history of kinds", "history of edges"),
)
NEEDS: dict[str, Callable[[VSA], bool]] = {
    **dict.fromkeys(("subset_product", "subset product of mixed bins"), lambda vsa: vsa.elementwise),
    **dict.fromkeys(("mirrored", "mirrored of mixed bins"), lambda vsa: vsa.elementwise and vsa.dim % 2 == 0),
    **dict.fromkeys(NEGATIVES, lambda vsa: vsa.negatable),
    **dict.fromkeys(POWERS, lambda vsa: vsa.frequencies is not None),
    "mirrored powers": lambda vsa: vsa.elementwise and vsa.frequencies is not None and vsa.dim % 2 == 0,
    "concatenated": lambda vsa: vsa.elementwise,
    "boxes beside sums": lambda vsa: vsa.elementwise and vsa.negatable,
    "random_fourier": lambda vsa: vsa.elementwise and not vsa.dtype.is_complex and vsa.dtype != torch.bool,
    "waves": lambda vsa: vsa.elementwise and vsa.dtype.is_floating_point,
}


def plan(name: str, vsa: VSA) -> Any:
    make = (VALUES | ROWS | MORE)[name]
    if not NEEDS.get(name, lambda _: True)(vsa):
        with pytest.raises(ValueError, match=vsa.name):
            make(vsa)
        pytest.skip(f"{vsa.name} is refused, as it should be")
    return make(vsa)


def test_every_listed_encoder_has_an_example() -> None:
    assert set(VALUES) == set(VALUE_ENCODERS)
    assert set(ROWS) == set(ENCODERS)
    for name, kind in (*VALUE_ENCODERS.items(), *ENCODERS.items()):
        assert kind.name == name


@pytest.mark.parametrize("name", VALUES)
def test_value_encoders_keep_the_laws(vsa: VSA, name: str) -> None:
    encode = plan(name, vsa)
    check_value_encoder(encode)
    assert not encode.drawn


@pytest.mark.parametrize("name", ROWS)
def test_encoders_keep_the_laws(vsa: VSA, name: str) -> None:
    encode = plan(name, vsa)
    check_encoder(encode)
    assert not encode.drawn


# Other lines of the same encoders: one MAP tells as much of them as another.
@pytest.mark.parametrize(("kind", "dtype"), [("MAP-C", "int8"), ("HRR", None), ("FHRR", None), ("BSC", None)])
@pytest.mark.parametrize("name", MORE)
def test_their_options_keep_the_laws(kind: str, dtype: str | None, name: str) -> None:
    encode = plan(name, torchvsa.architecture(kind, 2000, dtype))
    check_encoder(encode)
    assert not encode.drawn


# Of a plan, the laws are checked on a copy that is drawn; one architecture tells whether they take a drawn one too.
@pytest.mark.parametrize("name", [*VALUES, *ROWS, *MORE])
def test_laws_are_checked_of_what_is_drawn(name: str) -> None:
    vsa = torchvsa.architecture("FHRR" if name in POWERS else "MAP-C", 100)
    encode = plan(name, vsa).draw(torch.Generator().manual_seed(1))
    before = {key: tensor.clone() for key, tensor in encode.state_dict().items()}
    (check_value_encoder if name in VALUES else check_encoder)(encode)
    after = encode.state_dict()
    assert all(torch.equal(after[key], tensor) for key, tensor in before.items())


@pytest.mark.parametrize("dim", [63, 301])
@pytest.mark.parametrize("name", torchvsa.ARCHITECTURES)
def test_laws_hold_in_odd_dimensions(name: str, dim: int) -> None:
    # Every kind of encoder in every architecture, half of them in each dimension.
    vsa = torchvsa.architecture_near(name, dim)
    for kind, make in list(ROWS.items())[dim == 63 :: 2]:
        if NEEDS.get(kind, lambda _: True)(vsa):
            check_encoder(make(vsa))


@pytest.mark.parametrize("dtype", [torch.float64, torch.float16])
@pytest.mark.parametrize("name", ["sum", "product", "subset_product", "threshold_features", "history"])
def test_another_float_type_keeps_bipolar_codes(name: str, dtype: torch.dtype) -> None:
    encode = ROWS[name](torchvsa.MAP(300)).draw(torch.Generator().manual_seed(0))
    x = rows(20, encode.width)
    before = encode(x)
    assert torch.equal(encode.to(dtype)(x).float(), before)


@pytest.fixture
def compiler() -> Iterator[None]:
    yield
    torch.compiler.reset()


@pytest.mark.slow
@pytest.mark.usefixtures("compiler")
@pytest.mark.filterwarnings("ignore:`torch.jit:DeprecationWarning")  # of its own parts
def test_inductor_gives_the_same_bits() -> None:
    encode = MORE["held history"](torchvsa.MAP(512, dtype=torch.int8)).draw(torch.Generator().manual_seed(0))
    x = rows(10, encode.width)
    compiled = cast(Callable[..., torch.Tensor], torch.compile(encode, fullgraph=True))
    assert torch.equal(compiled(x), encode(x))
