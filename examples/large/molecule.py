"""A T cell receptor meets a virus peptide (orange): 6,339 atoms and the bonds of half of them, as rows of a texture.

Atomic coordinates: entry 1BD2 of the Protein Data Bank, https://doi.org/10.2210/pdb1BD2/pdb (Ding et al. 1998,
Immunity 8:403-411), whose data are in the public domain (CC0). `1bd2.npz` has the atoms without water: element, chain,
number of the residue, and position in 0.001 angstroms.
"""

from pathlib import Path

import numpy as np

import raymarch as rm

with np.load(Path(__file__).with_name("1bd2.npz")) as file:
    data = dict(file)
element, chain = data["elements"][data["element"]], data["chain"]
at = 1e-3 * (data["position"] - data["position"].mean(axis=0))
axes = np.linalg.svd(at, full_matrices=False)[2]  # lay the longest axis along x
at = at @ (axes * np.sign(np.linalg.det(axes))).T

at -= 0.5 * (at.min(axis=0) + at.max(axis=0))

COVALENT = {"C": 0.77, "N": 0.75, "O": 0.73, "S": 1.02}
VAN_DER_WAALS = {"C": 1.7, "N": 1.55, "O": 1.52, "S": 1.8}
radius = np.array([COVALENT[e] for e in element])
full = np.isin(data["chains"][chain], ("A", "B", "C"))  # drawn as touching atoms, the others in ball and stick


def bonds(longest=2.1):
    """Pairs of atoms that are closer than the sum of their covalent radii, found by way of cells."""
    cell = np.floor(at / longest).astype(np.int64) @ (1, 1000, 1000000)
    order = np.argsort(cell)
    pairs = []
    for step in np.ndindex(3, 3, 3):
        near = cell + np.subtract(step, 1) @ (1, 1000, 1000000)
        first, last = np.searchsorted(cell[order], near), np.searchsorted(cell[order], near, side="right")
        one = np.repeat(np.arange(len(at)), last - first)
        count = np.cumsum(last - first)
        other = order[np.arange(count[-1]) + np.repeat(first - count + (last - first), last - first)]
        close = np.linalg.norm(at[one] - at[other], axis=1) < 1.15 * (radius[one] + radius[other])
        pairs.append(np.stack([one, other])[:, close & (one < other)])
    return np.concatenate(pairs, axis=1)


def matrices(linear, offsets):
    """Matrices for column vectors, (n, 3, 4)."""
    return np.concatenate([linear, offsets[:, :, None]], axis=2)


CHAINS = {"A": "#4f7fc4", "B": "#4fb3a9", "C": "#ff8a1f", "D": "#d9476f", "E": "#9a6fd0"}
OTHERS = {"C": None, "N": "#4060ff", "O": "#ff4030", "S": "#ffd23a"}


def mixed(color, other, share):
    """A colour between two, as linear numbers."""
    one, two = (np.array([int(c[i : i + 2], 16) for i in (1, 3, 5)]) / 255.0 for c in (color, other or color))
    return (1.0 - share) * one**2.2 + share * two**2.2


palette = [
    rm.Material(albedo=mixed(color, other, 0.75 if name in "DE" else 0.12), roughness=0.4)
    for name, color in CHAINS.items()
    for other in OTHERS.values()
]
look = 4 * chain + data["element"]

size = np.where(full, [VAN_DER_WAALS[e] for e in element], 0.6 * radius)
balls = rm.instances(rm.sphere(1.0), matrices(size[:, None, None] * np.eye(3), at), (palette, look))

# Each bond is two halves, each with the colour of its atom: a stick of length 1, scaled to the length of the half.
pair = bonds()
pair = pair[:, ~full[pair].any(axis=0)]
one, other = np.concatenate([pair, pair[::-1]], axis=1)
along = 0.5 * (at[other] - at[one])
length = np.linalg.norm(along, axis=1)
up = along / length[:, None]
side = np.cross(up, np.where(np.abs(up[:, :1]) < 0.9, (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)))
side /= np.linalg.norm(side, axis=1, keepdims=True)
turn = np.stack([side, up, np.cross(side, up)], axis=2)
thick = rm.cylinder(0.26, 1.0)
sticks = rm.instances(thick, matrices(length[:, None, None] * turn, at[one] + 0.5 * along), (palette, look[one]))

scene = rm.Scene(
    balls | sticks,
    camera=rm.Camera(position=(-30, 18, 150), target=(-4, -1, 0), fov=30),
    lights=[rm.Sun(sun_direction=(0.4, 0.9, 0.65), intensity=1.2, shadow=True)],
    sky=rm.Sky((0.06, 0.09, 0.14), light=True),
    occlusion=rm.AmbientOcclusion(reach=3.0),
)
