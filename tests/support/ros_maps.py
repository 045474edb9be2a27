"""Maps of the shapes that robots are delivered with, and a file of nav2_map_server for them."""

import numpy as np
from PIL import Image
from scipy.ndimage import rotate

FREE, OCCUPIED, UNKNOWN = 254, 0, 205


def depot(columns=600, rows=300, seed=0, angle_deg=2.0):
    """A hall with rows of shelves on legs, pillars and a partition with doors, scanned askew.

    Shades of a trinary map, the northernmost row first: rays of a lidar leak through the walls,
    single cells of the walls are missing and some cells are noise.
    """
    rng = np.random.default_rng(seed)
    shades = np.full((rows, columns), UNKNOWN, dtype=np.uint8)
    shades[20:-20, 20:-20] = OCCUPIED
    shades[24:-24, 24:-24] = FREE
    for x in range(60, columns - 260, 60):
        for y in range(50, rows - 60, 22):
            shades[y : y + 3, x : x + 3] = OCCUPIED
            shades[y : y + 3, x + 24 : x + 27] = OCCUPIED
    shades[24:-24, columns - 220 : columns - 217] = OCCUPIED
    shades[70:94, columns - 220 : columns - 217] = FREE
    shades[rows - 100 : rows - 76, columns - 220 : columns - 217] = FREE
    for x in range(columns - 180, columns - 40, 45):
        for y in (80, rows - 90):
            shades[y : y + 12, x : x + 12] = OCCUPIED
    if angle_deg:
        shades = rotate(shades, angle_deg, reshape=False, order=0, cval=UNKNOWN)
    for _ in range(40):
        x = int(rng.integers(24, columns - 24))
        shades[: rng.integers(2, 22), x] = FREE
    shades[rng.random(shades.shape) < 0.0005] = OCCUPIED
    return shades


def maze(cells=12, cell=20, wall=2, seed=1):
    """A perfect maze: one way between any two of its cells, walls of a few cells of the raster."""
    rng = np.random.default_rng(seed)
    size = cells * cell + wall
    shades = np.full((size, size), FREE, dtype=np.uint8)
    for number in range(cells + 1):
        shades[number * cell : number * cell + wall] = OCCUPIED
        shades[:, number * cell : number * cell + wall] = OCCUPIED
    seen, way = {(0, 0)}, [(0, 0)]
    while way:
        row, column = way[-1]
        steps = [(row + 1, column), (row - 1, column), (row, column + 1), (row, column - 1)]
        fresh = [
            (r, c) for r, c in steps if (r, c) not in seen and 0 <= r < cells and 0 <= c < cells
        ]
        if not fresh:
            way.pop()
            continue
        r, c = fresh[rng.integers(len(fresh))]
        top, left = max(row, r) * cell, max(column, c) * cell
        if r != row:
            shades[top : top + wall, c * cell + wall : (c + 1) * cell] = FREE
        else:
            shades[r * cell + wall : (r + 1) * cell, left : left + wall] = FREE
        seen.add((r, c))
        way.append((r, c))
    return shades


def write_map(folder, name, shades, *, suffix=".pgm", keys="", origin="[-3.0, -2.0, 0.0]"):
    """Image and YAML file; the path of the latter."""
    folder.mkdir(parents=True, exist_ok=True)
    Image.fromarray(shades).save(folder / f"{name}{suffix}")
    path = folder / f"{name}.yaml"
    path.write_text(
        f"image: {name}{suffix}\nresolution: 0.05\norigin: {origin}\nnegate: 0\n"
        f"occupied_thresh: 0.65\nfree_thresh: 0.25\n{keys}"
    )
    return path
