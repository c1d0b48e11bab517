"""Order of cells in layers: barycentre sweeps and exchanges of neighbours, for few crossings."""

from __future__ import annotations

from collections.abc import Iterable

from dsc.drawing.layered.graph import Cell, Grid, effort

SMALL = 400
"""Number of cells up to which drawings get the more thorough treatment."""


def order_cells(grid: Grid) -> None:
    """Reorder every layer of the grid; keep the best order found, the first of equal ones."""
    rounds = effort(grid) + 4 * (len(grid.cells) <= SMALL)
    best, fewest = [list(layer) for layer in grid.layers], _crossings(grid)
    for number in range(2 * rounds):
        if fewest == 0:
            break
        _sweep(grid, downwards=number % 2 == 0)
        if len(grid.cells) <= SMALL:
            _exchange(grid)
        crossings = _crossings(grid)
        if crossings < fewest:
            best, fewest = [list(layer) for layer in grid.layers], crossings
    grid.layers[:] = best


def _sweep(grid: Grid, *, downwards: bool) -> None:
    layers = grid.layers[1:] if downwards else grid.layers[-2::-1]
    position = _positions(grid.layers)
    for layer in layers:
        keys = {}
        for cell in layer:
            fixed = _neighbours(grid.cells[cell], downwards=downwards)
            keys[cell] = sum(position[n] for n in fixed) / len(fixed) if fixed else position[cell]
        layer.sort(key=keys.__getitem__)
        for place, cell in enumerate(layer):
            position[cell] = place


def _neighbours(cell: Cell, *, downwards: bool) -> dict[int, float]:
    return cell.up if downwards else cell.down


def _positions(layers: Iterable[list[int]]) -> dict[int, int]:
    return {cell: place for layer in layers for place, cell in enumerate(layer)}


def _exchange(grid: Grid) -> None:
    """Exchange neighbours in a layer while that removes crossings."""
    position = _positions(grid.layers)
    for layer in grid.layers:
        for place in range(len(layer) - 1):
            one, other = layer[place], layer[place + 1]
            if _between(grid, one, other, position) > _between(grid, other, one, position):
                layer[place], layer[place + 1] = other, one
                position[one], position[other] = place + 1, place


def _between(grid: Grid, left: int, right: int, position: dict[int, int]) -> int:
    """Return the number of crossings of two cells' connections if `left` is left of `right`."""
    count = 0
    for downwards in (True, False):
        others = [position[n] for n in _neighbours(grid.cells[right], downwards=downwards)]
        own = [position[n] for n in _neighbours(grid.cells[left], downwards=downwards)]
        count += sum(1 for place in own for other in others if place > other)
    return count


def _crossings(grid: Grid) -> int:
    position = _positions(grid.layers)
    return sum(_inversions(grid, layer, position) for layer in grid.layers[:-1])


def _inversions(grid: Grid, layer: list[int], position: dict[int, int]) -> int:
    """Return the crossings below a layer, counted with a Fenwick tree (Barth, Jünger, Mutzel 2002)."""
    ends = [end for cell in layer for end in sorted(position[n] for n in grid.cells[cell].down)]
    tree = [0] * (max(ends, default=0) + 2)
    count = 0
    for already, end in enumerate(ends):
        index, not_right = end + 1, 0
        while index:
            not_right += tree[index]
            index &= index - 1
        count += already - not_right
        index = end + 1
        while index < len(tree):
            tree[index] += 1
            index += index & -index
    return count
