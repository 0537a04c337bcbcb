"""VTB and MBAT against matrices in NumPy, and MCR against whole numbers."""

import numpy as np
import pytest
import torch
from readings import seeded
from torch.testing import assert_close

from torchvsa import MBAT, MCR, VTB


def test_vtb_multiplies_each_part_by_the_matrix_of_the_key() -> None:
    vsa = VTB(25, torch.float64)
    a, key = vsa.random(2, generator=seeded())
    matrix = 5**0.5 * key.numpy().reshape(5, 5)
    whole = np.kron(np.eye(5), matrix)  # one block per part
    assert_close(vsa.bind(a, key), torch.from_numpy(whole @ a.numpy()))
    assert_close(vsa.unbind(a, key), torch.from_numpy(whole.T @ a.numpy()))
    assert_close(vsa.bind(a, vsa.inverse(key)), vsa.unbind(a, key))


def test_vtb_does_not_commute_and_has_an_identity_on_the_right_only() -> None:
    vsa = VTB(900)
    a, b, c = vsa.random(3, generator=seeded())
    assert abs(vsa.similarity(vsa.bind(a, b), vsa.bind(b, a))) < 0.2
    assert abs(vsa.similarity(vsa.bind(vsa.bind(a, b), c), vsa.bind(a, vsa.bind(b, c)))) < 0.2
    assert_close(vsa.bind(a, vsa.identity()), a)
    assert vsa.similarity(vsa.bind(vsa.identity(), a), a) < 0.2


def matrix_of(vsa: MBAT, key: torch.Tensor) -> np.ndarray:
    """The matrix by which a key multiplies: column i is the image of the i-th unit vector."""
    return vsa.bind(torch.eye(vsa.dim, dtype=vsa.dtype), key).T.numpy()


def test_mbat_multiplies_by_an_orthogonal_matrix_of_4_by_4_blocks() -> None:
    vsa = MBAT(40, torch.float64)
    a, key = vsa.random(2, generator=seeded())
    matrix = matrix_of(vsa, key)
    np.testing.assert_allclose(matrix @ matrix.T, np.eye(40), atol=1e-12)
    np.testing.assert_allclose(np.sort(np.abs(matrix), 1)[:, -4:], 0.5)
    assert (np.abs(matrix) > 1e-12).sum() == 40 * 4
    rows, columns = np.nonzero(np.abs(matrix) > 1e-12)
    assert (rows % 10 == columns % 10).all()
    assert_close(vsa.bind(a, key), torch.from_numpy(matrix @ a.numpy()))
    assert_close(vsa.unbind(a, key), torch.from_numpy(matrix.T @ a.numpy()))


def test_mbat_binds_like_the_product_of_matrices() -> None:
    vsa = MBAT(400, torch.float64)
    a, b, c = vsa.random(3, generator=seeded())
    assert_close(vsa.bind(vsa.bind(a, b), c), vsa.bind(a, vsa.bind(b, c)))
    assert_close(matrix_of(vsa, vsa.bind(b, c)), torch.from_numpy(matrix_of(vsa, c) @ matrix_of(vsa, b)).numpy())
    assert not torch.allclose(vsa.bind(a, b), vsa.bind(b, a))
    for same in (vsa.bind(a, vsa.identity()), vsa.bind(vsa.identity(), a), vsa.unbind(vsa.bind(a, b), b)):
        assert_close(same, a)
    assert_close(vsa.bind(a, vsa.inverse(b)), vsa.unbind(a, b))


def test_quaternions_multiply_as_hamilton_wrote() -> None:
    vsa = MBAT(4, torch.float64)
    one, i, j, k = torch.eye(4, dtype=torch.float64)  # √d / 2 is 1
    for a, b, product in ((i, j, k), (j, k, i), (k, i, j), (j, i, -k), (i, i, -one), (one, k, k)):
        assert torch.equal(vsa.bind(a, b), product)


def test_mcr_adds_whole_numbers() -> None:
    vsa = MCR(300)
    x, y = vsa.random(2, 5, generator=seeded())
    a, b = vsa.numbers(x).int(), vsa.numbers(y).int()
    assert torch.equal(vsa.numbers(vsa.bind(x, y)).int(), (a + b) % 16)
    assert torch.equal(vsa.numbers(vsa.unbind(x, y)).int(), (a - b) % 16)
    assert torch.equal(vsa.from_numbers(vsa.numbers(x)), x)
    assert torch.bincount(a.flatten(), minlength=16).min() > 0


def test_mcr_bundles_to_the_nearest_number() -> None:
    vsa = MCR(4)
    xs = vsa.from_numbers(torch.tensor([[0, 1, 15, 3], [0, 2, 0, 11], [3, 2, 1, 3]]))
    # 3 and 11 are opposite, and 0 and 3 with twice 0 are nearest to 1.
    assert vsa.numbers(vsa.bundle(xs)).tolist() == [1, 2, 0, 3]
    two = vsa.bundle(xs[:2])
    assert vsa.numbers(two).tolist() == [0, 1, 15, 0], "halfway goes to the lower number"
    assert two[3] == 0, "opposite numbers cancel"


@pytest.mark.parametrize("dim", [10, 4001])
def test_dims_that_are_not_allowed_name_the_nearest(dim: int) -> None:
    squares = {10: "9 and 16", 4001: "3969 and 4096"}
    with pytest.raises(ValueError, match=rf"VTB does not allow dim={dim}; the nearest allowed: {squares[dim]}"):
        VTB(dim)
    fours = {10: "8 and 12", 4001: "4000 and 4004"}
    with pytest.raises(ValueError, match=rf"MBAT does not allow dim={dim}; the nearest allowed: {fours[dim]}"):
        MBAT(dim)
