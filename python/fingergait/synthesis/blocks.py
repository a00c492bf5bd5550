"""Block structures of uncertainty, in the notation of MATLAB's mussv."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

Blocks = list[tuple[int, int]]
Kind = Literal["full", "repeated", "real"]


@dataclass(frozen=True)
class Block:
    """One block of Delta with its place: w[rows] = Delta_i z[cols].

    Attributes
    ----------
    kind : "full" complex (r, c), "repeated" complex scalar delta I_r, or "real" repeated scalar
    rows : its slice of w = Delta z, the inputs of M
    cols : its slice of z = M w, the outputs of M
    """

    kind: Kind
    rows: slice
    cols: slice

    @property
    def r(self) -> int:
        return int(self.rows.stop - self.rows.start)

    @property
    def c(self) -> int:
        return int(self.cols.stop - self.cols.start)


def parse_blocks(blocks: Sequence[tuple[int, int]]) -> list[Block]:
    """The blocks with their places.

    Parameters
    ----------
    blocks : as in mussv: (r, c) a full complex block of r rows and c columns, (r, 0) a repeated complex scalar
        delta I_r, (-r, 0) a repeated real one. (1, 1) and (1, 0) are the same; (-1, 1) is read as (-1, 0).
    """
    parsed: list[Block] = []
    i = j = 0
    for r, c in blocks:
        if r == 0 or c < 0 or (r < 0 and c not in (0, 1)) or (r < -1 and c == 1):
            raise ValueError(
                f"blocks: expected (r, c) full, (r, 0) repeated complex or (-r, 0) repeated real, found {(r, c)}"
            )
        kind: Kind = "real" if r < 0 else "repeated" if c == 0 and r > 1 else "full"
        rows, cols = abs(r), c if r > 0 and c > 0 else abs(r)
        parsed.append(Block(kind, slice(i, i + rows), slice(j, j + cols)))
        i, j = i + rows, j + cols
    if not parsed:
        raise ValueError("blocks: at least one block is needed")
    return parsed


def real_scalars(blocks: Sequence[tuple[int, int]]) -> Blocks:
    """The structure with every scalar block real: for parameters that are constants, such as a mass."""
    return [(-abs(r), 0) if c == 0 or (r, c) == (1, 1) else (r, c) for r, c in blocks]


def shape(blocks: Sequence[Block]) -> tuple[int, int]:
    """(outputs, inputs) of a matrix M that closes the loop with these blocks."""
    return blocks[-1].cols.stop, blocks[-1].rows.stop
