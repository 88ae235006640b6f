"""The bottles of many simulations at once."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np

from dextron_bench.world import model
from dextron_bench.world.bottle import Bottle

FIELDS = ("body_mass", "body_inertia", "geom_friction", "geom_size", "geom_rbound", "geom_aabb", "bvh_aabb")


@cache
def model_bottle() -> Bottle:
    """The bottle of the model."""
    compiled, (body, geom, _) = model.load(), model.bottle_indices()
    friction, radius = compiled.geom_friction[geom, 0], compiled.geom_size[geom, 0]
    return Bottle(float(compiled.body_mass[body]), float(friction), float(radius))


class Bottles:
    """Gives each simulation of a batch its own bottle; the physics is bit-equal to a model compiled with the bottle."""

    def __init__(self, batch: Any) -> None:
        """Takes the `mujoco.batch.Batch` of the simulations."""
        self._batch = batch
        self._fields = {name: batch.expand(name) for name in FIELDS}
        self._body, self._geom, self._bounds = model.bottle_indices()

    def set(self, ids: np.ndarray, bottles: Sequence[Bottle]) -> None:
        """Puts bottles into simulations `ids` (n,)."""
        mass, friction, radius = np.array([(one.mass, one.friction, one.radius) for one in bottles]).T
        arrays, half_height = self._fields, model.load().geom_size[self._geom, 1]
        across = mass * (3.0 * radius * radius + 4.0 * half_height * half_height) / 12.0
        arrays["body_mass"][ids, self._body] = mass
        arrays["body_inertia"][ids, self._body] = np.stack([across, across, mass * radius * radius / 2.0], axis=1)
        arrays["geom_friction"][ids, :, 0] = friction[:, None]
        arrays["geom_size"][ids, self._geom, 0] = radius
        arrays["geom_rbound"][ids, self._geom] = np.sqrt(radius * radius + half_height * half_height)
        for boxes in (arrays["geom_aabb"][:, self._geom], arrays["bvh_aabb"][:, self._bounds]):
            boxes[ids, 3:5] = radius[:, None]
        self._batch.set_const(np.sort(ids))

    def copy(self, source: np.ndarray, target: np.ndarray) -> None:
        """Copies the bottles of simulations `source` (n,) into simulations `target` (n,)."""
        for rows in self._fields.values():
            rows[target] = rows[source]
        self._batch.set_const(np.sort(target))
