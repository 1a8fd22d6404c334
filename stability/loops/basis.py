"""Coordinates in which a period of a sampled loop is nearly block diagonal, from its eigenvectors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Eigenvalues this close, of what the larger is below 1, are a block; its coupling is that share of the same.
CLOSE, SHARE = 0.1, 0.3
#: Condition number of coordinates beyond which they are none; largest block; a smaller imaginary part is none.
WORST, MOST, TINY = 1e8, 4, 1e-12


@dataclass(frozen=True, kw_only=True)
class Basis:
    """Coordinates Z = V y in which F is nearly block diagonal.

    Attributes:
        columns: V. Shape (order, order).
        inverse: V^-1.
        blocks: Sizes of the blocks, 1 to 4.
        norms: Bounds on the norms of the blocks of V^-1 F V. Shape (blocks, blocks).
    """

    columns: Array
    inverse: Array
    blocks: tuple[int, ...]
    norms: Array

    def of_rows(self, rows: Array) -> Array:
        """Norms by block of rows over y. Shape (..., blocks)."""
        starts = np.cumsum((0, *self.blocks[:-1]))
        return np.sqrt(np.add.reduceat(rows**2, starts, axis=-1))

    def of_columns(self, columns: Array) -> Array:
        """Norms by block of columns over y. Shape (blocks, ...)."""
        return np.moveaxis(self.of_rows(np.moveaxis(columns, 0, -1)), -1, 0)


def basis_of(f: Array) -> Basis | None:
    """Real eigenvectors, pairs for complex ones and for nearly equal ones; None where they are nearly dependent."""
    from scipy.linalg import eig, matrix_balance

    # states have units of their own
    balanced, scale = (np.asarray(part, dtype=np.float64) for part in matrix_balance(f, permute=False))
    found: Any = eig(balanced)
    values: Any = found[0]
    vectors: Any = found[1]
    columns, blocks = [], []
    left = [int(i) for i in np.argsort(-np.abs(values)) if values[i].imag > -TINY]  # one of each conjugate pair
    while left:
        i = left.pop(0)
        single, near, size = _size(values[i]) == 1, [], _size(values[i])
        for k in left:
            if _close(values[i], values[k]) and size + _size(values[k]) <= MOST:
                near.append(k)
                size += _size(values[k])
        if near or (not single and _close(values[i], values[i].conjugate())):
            left = [k for k in left if k not in near]
            columns += list(_plane(balanced, values[[i, *near]]).T)
        else:
            columns += [vectors[:, i].real] if single else [vectors[:, i].real, vectors[:, i].imag]
        blocks.append(len(columns) - sum(blocks))
    made = np.array(columns).T
    if np.linalg.cond(made) > WORST:
        return None
    return with_columns(f, scale @ made, tuple(blocks))


def _size(value: complex) -> int:
    """Columns of an eigenvalue, and of its conjugate."""
    return 2 if value.imag > TINY else 1


def _close(one: complex, other: complex) -> bool:
    return abs(one - other) < CLOSE * _room(np.array([one, other]))


def _room(values: Any) -> float:
    return max(1 - float(np.max(np.abs(values))), 1e-9)


def _plane(f: Array, cluster: Any) -> Array:
    """What nearly equal eigenvalues leave invariant: their eigenvectors are nearly the same, and tell it badly."""
    from scipy.linalg import schur

    one = np.eye(len(f))
    wanted, count = one, sum(map(_size, cluster))
    for value in cluster:
        of_pair = f @ f - 2 * value.real * f + abs(value) ** 2 * one
        wanted = wanted @ (of_pair if _size(value) == 2 else f - value.real * one)
    plane = np.linalg.svd(wanted)[2][-count:].T
    found: Any = schur(plane.T @ f @ plane)
    form, turned = found
    share, lengths = SHARE * _room(cluster), [1.0]
    for j in range(1, count):  # every vector so short that it adds little of those before it
        above = np.abs(form[:j, j])
        if form[j, j - 1] != 0:  # the second of a pair, balanced with the first
            beside = max(float(above[-1]), 1e-300)
            lengths.append(lengths[-1] * max(min(1.0, share / beside), np.sqrt(abs(form[j, j - 1]) / beside)))
            continue
        if j + 1 < count and form[j + 1, j] != 0:
            above = np.maximum(above, np.abs(form[:j, j + 1]))
        lengths.append(lengths[-1] * min(1.0, share / max(float(above.max()), 1e-300)))
    return np.asarray(plane @ turned @ np.diag(lengths), dtype=np.float64)


def with_columns(f: Array, columns: Array, blocks: tuple[int, ...]) -> Basis:
    """The coordinates of given columns."""
    inverse = np.asarray(np.linalg.inv(columns), dtype=np.float64)
    # every block at the head of a square
    count, side = len(blocks), max(blocks)
    place = np.array([side * k + i for k, size in enumerate(blocks) for i in range(size)])
    padded = np.zeros((side * count, side * count))
    padded[np.ix_(place, place)] = inverse @ f @ columns
    squares = padded.reshape(count, side, count, side).swapaxes(1, 2)
    norms = np.asarray(np.linalg.norm(squares, 2, axis=(2, 3)), dtype=np.float64)
    for k, size in enumerate(blocks):
        if size > 2:  # as the checker bounds it
            norms[k, k] = np.sqrt(np.linalg.norm(squares[k, k], 1) * np.linalg.norm(squares[k, k], np.inf))
    return Basis(columns=columns, inverse=inverse, blocks=blocks, norms=norms)


def diagonal(matrix: Array, blocks: tuple[int, ...]) -> Array:
    """The blocks on the diagonal alone."""
    found, first = np.zeros_like(matrix), 0
    for size in blocks:
        part = slice(first, first + size)
        found[part, part] = matrix[part, part]
        first += size
    return found
