"""The laws of encoders and value encoders."""

import copy
import json
import pickle
from collections.abc import Callable
from typing import Any

import torch
from torch import Tensor
from torch.testing import assert_close

from torchvsa.encoders.base import UNOBSERVED, Encoder, ValueEncoder
from torchvsa.errors import ShapeError
from torchvsa.testing._laws import check, refuses, require, same, seeded

_AnyEncoder = Encoder | ValueEncoder
_ROWS = 24
"""Rows per batch: three blocks of 7, and a smaller one."""


def check_encoder(encoder: Encoder) -> None:
    """Check the laws of encoders. Raises `AssertionError` that names the first broken law.

    The encoder is not changed. Of a plan (an encoder without codebooks), a copy is drawn from seed 0.
    """
    _check(encoder, _ENCODER_LAWS)


def check_value_encoder(encoder: ValueEncoder) -> None:
    """Check the laws of value encoders. Raises `AssertionError` that names the first broken law.

    The encoder is not changed. Of a plan (an encoder without codebooks), a copy is drawn from seed 0.
    """
    _check(encoder, _VALUE_LAWS)


def _check(encoder: Any, laws: tuple[Callable[[Any], None], ...]) -> None:
    if not encoder.drawn:
        check(encoder, (_a_plan_refuses_to_encode, _an_equal_plan_draws_the_same_bits))
        encoder = copy.deepcopy(encoder).draw(seeded(0))
    check(encoder, laws)


def _inputs(encoder: _AnyEncoder, seed: int = 0, observed: bool = False) -> Tensor:
    """Random readings with both ends of the range, and with NaN if the encoder takes it, unless `observed`."""
    shape = (_ROWS, encoder.width) if isinstance(encoder, Encoder) else (_ROWS,)
    x = torch.rand(shape, generator=seeded(seed), dtype=torch.float64)
    x[0], x[1] = 0, 1
    if isinstance(encoder, Encoder) and not observed:
        x[2:][torch.rand(x[2:].shape, generator=seeded(seed + 1)) < 0.25] = torch.nan
    return x


def _alike(encoder: _AnyEncoder, a: Tensor, b: Tensor) -> None:
    """Compare bits, or values if Fourier transforms or complex numbers may round in another order.

    Sums of unit numbers that nearly cancel are scaled up again, and their rounding with them.
    """
    if encoder.vsa.elementwise and not encoder.vsa.dtype.is_complex:
        same(a, b)
    else:
        assert_close(a, b, rtol=1e-5, atol=1e-4)


def _made_again(encoder: Any) -> Any:
    """A plan from the encoder's config, after a round trip through JSON."""
    return type(encoder).from_config(json.loads(json.dumps(encoder.config())), encoder.vsa)


def _a_plan_refuses_to_encode(plan: _AnyEncoder) -> None:
    require(not plan.drawn)
    refuses(ValueError, lambda: plan(_inputs(plan, observed=True)))


def _an_equal_plan_draws_the_same_bits(plan: _AnyEncoder) -> None:
    drawn, again = (part.draw(seeded(3)) for part in (copy.deepcopy(plan), _made_again(plan)))
    if again.drawn:  # else its tensors are given, not drawn
        same(again(_inputs(plan)), drawn(_inputs(plan)))
    require(not plan.drawn, "drawing a copy changed the plan")


def _codes_have_the_type_and_dimension_of_the_architecture(encoder: _AnyEncoder) -> None:
    x = _inputs(encoder)
    codes = encoder(x)
    require(codes.shape == (_ROWS, encoder.vsa.dim), f"shape {tuple(codes.shape)}")
    require(codes.dtype in (encoder.vsa.dtype, encoder.vsa.accumulator), f"type {codes.dtype}")
    require(codes.isfinite().all(), "elements are not finite")
    require(encoder(x[:0]).shape == (0, encoder.vsa.dim), "an empty batch does not give an empty batch")


def _readings_of_another_float_type_have_the_same_type_of_codes(encoder: _AnyEncoder) -> None:
    x = (_inputs(encoder) * 8).round() / 8  # exact in both types
    same(encoder(x.float()), encoder(x))


def _a_batch_is_its_singles(encoder: _AnyEncoder) -> None:
    x = _inputs(encoder)
    whole = encoder(x)
    for size in (1, 7):
        _alike(encoder, torch.cat([encoder(part) for part in x.split(size)]), whole)
    _alike(encoder, encoder(x.flip(0)), whole.flip(0))


def _equal_cells_have_equal_codes(encoder: _AnyEncoder) -> None:
    x = _inputs(encoder)
    cells = encoder.cells(x)
    require(cells.shape == x.shape, f"cells have the shape {tuple(cells.shape)}")
    require(bool(((cells == UNOBSERVED) == x.isnan()).all()), "-1 is not the cell of NaN, and of nothing else")
    require((cells.dtype == torch.int64) == encoder.discrete, f"discrete={encoder.discrete}, yet cells: {cells.dtype}")
    _alike(encoder, encoder.encode(cells), encoder(x))
    near = torch.where(x.isnan(), x, (x + 1e-3).clamp(max=1))
    equal = (encoder.cells(near) == cells).reshape(_ROWS, -1).all(1)
    _alike(encoder, encoder(near)[equal], encoder(x)[equal])


def _readings_out_of_range_are_refused(encoder: _AnyEncoder) -> None:
    for wrong, bound in ((-0.5, 0.0), (1.5, 1.0), (torch.inf, 1.0)):
        x = _inputs(encoder, observed=True)
        x[-1], nearest = wrong, x.clone()
        nearest[-1] = bound
        refuses(ValueError, lambda x=x: encoder(x))
        same(encoder.cells(x), encoder.cells(nearest))


def _the_seed_decides_the_bits(encoder: _AnyEncoder) -> None:
    first, again, other = (_made_again(encoder).draw(seeded(seed)) for seed in (5, 5, 6))
    if first.drawn:
        x = _inputs(encoder)
        same(first(x), again(x))
        require(not torch.equal(first(x), other(x)), "another seed gives the same bits")


def _its_description_and_tensors_make_it_again(encoder: _AnyEncoder) -> None:
    tensors = encoder.state_dict()
    layout = {name: (tensor.dtype, tuple(tensor.shape)) for name, tensor in tensors.items()}
    require(encoder.layout() == layout, f"layout() says {encoder.layout()}, state_dict() holds {layout}")
    plan = _made_again(encoder)
    require(plan.config() == encoder.config(), f"config() of its plan is {plan.config()}")
    require(plan.layout() == layout, "the layout of its plan differs")
    again = plan.take(tensors)
    require(again.drawn)
    same(again(_inputs(encoder)), encoder(_inputs(encoder)))
    encoder.check()


def _a_state_dict_carries_all_that_was_drawn(encoder: _AnyEncoder) -> None:
    other = _made_again(encoder).draw(seeded(7))
    if other.drawn:
        other.load_state_dict(encoder.state_dict())
        same(other(_inputs(encoder)), encoder(_inputs(encoder)))


def _copies_answer_alike_and_are_independent(encoder: _AnyEncoder) -> None:
    x = _inputs(encoder)
    before = encoder(x)
    twin = copy.deepcopy(encoder)
    same(twin(x), before)
    same(pickle.loads(pickle.dumps(encoder))(x), before)
    other = _made_again(encoder).draw(seeded(7))
    if other.drawn:
        twin.load_state_dict(other.state_dict())
        same(twin(x), other(x))
        same(encoder(x), before)


_LAWS: tuple[Callable[[Any], None], ...] = (
    _codes_have_the_type_and_dimension_of_the_architecture,
    _readings_of_another_float_type_have_the_same_type_of_codes,
    _a_batch_is_its_singles,
    _equal_cells_have_equal_codes,
    _readings_out_of_range_are_refused,
    _the_seed_decides_the_bits,
    _its_description_and_tensors_make_it_again,
    _a_state_dict_carries_all_that_was_drawn,
    _copies_answer_alike_and_are_independent,
)


def _rows_have_one_column_per_reading(encoder: Encoder) -> None:
    x = _inputs(encoder)
    for wrong in (x[0], x[:, :-1], torch.cat([x, x], 1), x[None]):
        refuses(ShapeError, lambda wrong=wrong: encoder(wrong))


def _nothing_observed_is_one_neutral_code(encoder: Encoder) -> None:
    x = torch.full((3, encoder.width), torch.nan, dtype=torch.float64)
    codes = encoder(torch.cat([_inputs(encoder), x]))[-3:]
    require(codes.isfinite().all(), "elements are not finite")
    _alike(encoder, codes, encoder(x[:1]).expand(3, -1))


def _an_unobserved_reading_changes_the_code(encoder: Encoder) -> None:
    x = _inputs(encoder, observed=True)
    for column in range(encoder.sensors):
        hidden = x.clone()
        hidden[:, column] = torch.nan
        require(not torch.equal(encoder(hidden), encoder(x)), f"column {column} is not asked at all")


def _windows_of_recorded_readings_are_those_of_live_ones(encoder: Encoder) -> None:
    x = torch.rand(4, 6, encoder.sensors, generator=seeded(2), dtype=torch.float64)
    x[torch.rand(x.shape, generator=seeded(3)) < 0.3] = torch.nan
    recorded = encoder.windows(x.flatten(0, 1), torch.tensor([9, 2, 5, 0]).repeat_interleave(6)).unflatten(0, (4, 6))
    for robots in (torch.arange(4), torch.tensor([2]), torch.tensor([3, 1])):
        past = encoder.start(len(robots))
        for step in range(6):
            before, now = past.clone(), x[robots, step]
            window, past_after = encoder.step(now, past)
            require(window.shape == (len(robots), encoder.width), f"windows have the shape {tuple(window.shape)}")
            same(window, recorded[robots, step])
            same(past, before)
            same(now, x[robots, step])
            past = past_after


_ENCODER_LAWS = (
    *_LAWS,
    _rows_have_one_column_per_reading,
    _nothing_observed_is_one_neutral_code,
    _an_unobserved_reading_changes_the_code,
    _windows_of_recorded_readings_are_those_of_live_ones,
)


def _any_shape_is_a_batch(encoder: ValueEncoder) -> None:
    x = _inputs(encoder)
    _alike(encoder, encoder(x.view(2, 3, 4)), encoder(x).view(2, 3, 4, -1))
    _alike(encoder, encoder(x[5]), encoder(x)[5])


def _a_reading_resembles_itself(encoder: ValueEncoder) -> None:
    codes = encoder(_inputs(encoder))
    assert_close(encoder.vsa.similarity(codes, codes), torch.ones(_ROWS))


def _what_was_not_observed_has_no_code(encoder: ValueEncoder) -> None:
    refuses(ValueError, lambda: encoder(torch.tensor([0.5, torch.nan])))


_VALUE_LAWS = (*_LAWS, _any_shape_is_a_batch, _a_reading_resembles_itself, _what_was_not_observed_has_no_code)
