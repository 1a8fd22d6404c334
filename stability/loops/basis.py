"""Coordinates in which a period of a sampled loop is nearly block diagonal, from its eigenvectors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Eigenvalues this close, of what the larger is below 1, are a block; its coupling is that share of the same.
CLOSE, SHARE = 0.1, 0.3
#: Condition number of coordinates beyond which they are none.
WORST = 1e8


@dataclass(frozen=True, kw_only=True)
class Basis:
    """Coordinates Z = V y in which F is nearly block diagonal.

    Attributes:
        columns: V. Shape (order, order).
        inverse: V^-1.
        blocks: Sizes of the blocks, 1 or 2.
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
    columns, blocks, done = [], [], set[int]()
    for i in np.argsort(-np.abs(values)):
        if int(i) in done:
            continue
        if abs(values[i].imag) > 1e-12:
            partner = int(np.argmin(np.abs(values - values[i].conjugate())))
            done |= {int(i), partner}
            columns += [vectors[:, i].real, vectors[:, i].imag]
            blocks.append(2)
        else:
            done.add(int(i))
            columns.append(vectors[:, i].real)
            blocks.append(1)
    made, blocks = _paired(balanced, np.array(columns).T, blocks)
    if np.linalg.cond(made) > WORST:
        return None
    return with_columns(f, scale @ made, tuple(blocks))


def _paired(f: Array, columns: Array, blocks: list[int]) -> tuple[Array, list[int]]:
    """Nearly equal real eigenvalues as a block: one eigenvector, and the direction to the other, short enough."""
    kept, sizes, k, first = [], [], 0, 0
    while k < len(blocks):
        one = columns[:, first] / np.linalg.norm(columns[:, first])
        if blocks[k] == 1 and k + 1 < len(blocks) and blocks[k + 1] == 1:
            other = columns[:, first + 1] / np.linalg.norm(columns[:, first + 1])
            other = other if other @ one > 0 else -other
            apart = max(float(np.linalg.norm(other - one)), 1e-300)
            values = [v @ f @ v for v in (one, other)]
            room = max(1 - max(map(abs, values)), 1e-9)
            if abs(values[1] - values[0]) < CLOSE * room:
                reach = abs(values[1] - values[0]) / apart
                kept += [one, (other - one) / apart * min(1.0, SHARE * room / max(reach, 1e-300))]
                sizes.append(2)
                k, first = k + 2, first + 2
                continue
        kept += list(columns[:, first : first + blocks[k]].T)
        sizes.append(blocks[k])
        first += blocks[k]
        k += 1
    return np.array(kept).T, sizes


def with_columns(f: Array, columns: Array, blocks: tuple[int, ...]) -> Basis:
    """The coordinates of given columns."""
    inverse = np.asarray(np.linalg.inv(columns), dtype=np.float64)
    inside, ends = inverse @ f @ columns, np.cumsum((0, *blocks))
    norms = np.array([
        [np.linalg.norm(inside[r : r + p, c : c + q], 2) for c, q in zip(ends, blocks, strict=False)]
        for r, p in zip(ends, blocks, strict=False)
    ], dtype=np.float64)  # fmt: skip
    return Basis(columns=columns, inverse=inverse, blocks=blocks, norms=norms)


def diagonal(matrix: Array, blocks: tuple[int, ...]) -> Array:
    """The blocks on the diagonal alone."""
    found, first = np.zeros_like(matrix), 0
    for size in blocks:
        part = slice(first, first + size)
        found[part, part] = matrix[part, part]
        first += size
    return found
