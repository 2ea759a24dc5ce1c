"""What all engines of bodies share: corners of the box, overlaps and energies of the discs."""
import numpy as np

import problems

TABLE = problems.disc_table()
BOX = problems.DISCS_BOX
WALLS = [((0, 0), (BOX, 0)), ((BOX, 0), (BOX, BOX)), ((BOX, BOX), (0, BOX)), ((0, BOX), (0, 0))]


def overlap(at):
    """Deepest overlap of two discs, or of a disc and a wall, in radii."""
    radius = TABLE[2]
    order = np.argsort(at[:, 0])
    x = at[order]
    deepest = max(0.0, float(np.max(radius - x)), float(np.max(x + radius - BOX)))
    # Along x sorted discs: the k-th neighbours, until none is near enough.
    for k in range(1, len(x)):
        dx = x[k:, 0] - x[:-k, 0]
        near = dx < 2 * radius
        if not near.any():
            break
        distance = np.hypot(dx[near], (x[k:, 1] - x[:-k, 1])[near])
        deepest = max(deepest, float(np.max(2 * radius - distance)))
    return deepest / radius


def answer(contacts, penetration, velocities):
    energy = float(np.sum(np.square(velocities)))
    start = float(np.sum(np.square(TABLE[1])))
    return {"contacts": int(contacts), "penetration": penetration, "energy_change": energy / start - 1}
