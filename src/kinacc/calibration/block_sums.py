"""Normal equations of VEC models by blocks of rows, of which candidates are trained and tried.

Unknowns are sorted by Chebyshev order, so that those of a lower order are leading ones of a higher.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from kinacc.calibration import ridge, vec_fit
from kinacc.calibration.basis_expansion import Group, applied, gram
from kinacc.calibration.held import Placed
from kinacc.calibration.observations import Observations
from kinacc.calibration.system import PoseSystem
from kinacc.calibration.vec_fit import Prior
from kinacc.kinematics.vec import VECModel

FAR = 4.0  # medians of the error; a reading farther off than that counts less
_FIRST = 12  # order summed up to at first; few searches go beyond, where sums are ten times larger
_SCREENINGS = 3  # of the rows trained on; the weights hardly change any more
_CONSTANT = Prior(1.0, 1e-3, 1.0, 1e-3)  # of what is screened with, which leans on no prior
_GAUGE_RIDGE = 1e-9  # holds constants no pose shows, as a share of those it does

Motions = tuple[np.ndarray, list[Group]]  # (rows, 6, E + 1): [J | r], and what spreads it


def weights(squared_mm2: np.ndarray) -> np.ndarray:
    """Weights (n,) that bound squared errors (n,)."""
    far = max(FAR**2 * float(np.median(squared_mm2)), np.finfo(float).tiny)
    return far / np.maximum(squared_mm2, far)


@dataclass(frozen=True)
class BlockSums:
    """By block: ``[J | r]`` as motions, part by part, and the count of residuals.

    ``kept`` (E, f): derivative of the frames' motions by what is not held of them. Unknowns are the
    ``flat`` ones (frames, constants and direction offsets), the residual, then ``bent`` for each
    Chebyshev order.
    """

    motions: Mapping[int, list[Motions]]
    components: Mapping[int, int]
    kept: np.ndarray
    empty: VECModel
    free: np.ndarray
    _normal: dict[int, np.ndarray] = field(default_factory=dict)

    @classmethod
    def of(
        cls,
        observations: Observations,
        block: np.ndarray,
        empty: VECModel,
        frames: Placed,
        weight: float,
    ) -> BlockSums:
        """Of the rows of every ``block`` (n,) from 0, linear about no errors."""
        free, flange = vec_fit.flange_model(observations, empty)
        motions, components = {}, {}
        for number in (int(each) for each in np.unique(block[block >= 0])):
            part = observations.select(block == number)
            system = PoseSystem(part, flange, frames.inner, weight)
            motions[number] = list(system.gram_blocks(np.zeros(system.size)))
            components[number] = part.components
        return cls(motions, components, frames.kept, empty, free)

    @property
    def bent(self) -> int:
        """Unknowns of one Chebyshev order above 0."""
        return self.empty.coefficients.size // (self.empty.order + 1)

    @property
    def flat(self) -> int:
        """Unknowns that every candidate has."""
        offsets = int(self.free.sum()) - self.empty.coefficients.size
        return self.kept.shape[1] + self.bent + offsets

    def far(self, left_out: Collection[int | None]) -> dict[int, np.ndarray]:
        """Share (rows,) taken from every row of the blocks trained on: 0 but of far ones."""
        kept = [number for number in self.motions if number not in left_out]
        shares = {number: np.zeros(1) for number in kept}
        for _ in range(_SCREENINGS):
            constant = self.trained(0, (_CONSTANT,), shares)
            squared = [self.errors(constant, 0, number)[:, 0] for number in kept]
            ends = np.cumsum([len(each) for each in squared])[:-1]
            found = np.split(weights(np.concatenate(squared)), ends)
            shares = {number: 1.0 - each for number, each in zip(kept, found, strict=True)}
        return shares

    def trained(
        self, order: int, priors: Sequence[Prior], far: Mapping[int, np.ndarray]
    ) -> np.ndarray:
        """Unknowns (P, priors) fitted to the blocks of ``far``, less these shares of their rows.

        Posterior means at the residual variance that they leave. The residual's own is one.
        """
        flat, size = self.flat, self.flat + 1 + self.bent * order
        sums, weighted = self._sums(order), self._weighted(order, far)
        first, *others = (sums[number][:size, :size] for number in far)
        normal = first - weighted
        for each in others:
            normal += each
        # Frames, constants and offsets have no prior worth the name: eliminated once for all.
        own = normal[:flat, :flat]
        own = own + np.diag(_GAUGE_RIDGE * np.maximum(np.diag(own), own.trace() / max(flat, 1)))
        sides = np.linalg.solve(own, normal[:flat, flat:])
        left = normal[flat:, :flat] @ sides
        np.subtract(normal[flat:, flat:], left, out=left)
        del normal
        freedom = sum(self.components[number] for number in far) - flat
        found = np.ones((size, len(priors)))
        decays = list(dict.fromkeys(prior.decay for prior in priors if order))
        for decay in decays:
            of_shape = [i for i, prior in enumerate(priors) if prior.decay == decay]
            unit = self._falling(priors[of_shape[0]], order)
            std = np.array([priors[i].delta_mm for i in of_shape])
            scaled = np.multiply(left, unit[:, None], out=left if decay == decays[-1] else None)
            scaled *= unit
            found[flat + 1 :, of_shape] = unit[1:, None] * ridge.steps(scaled, freedom, std)
        found[:flat] = -sides[:, :1] - sides[:, 1:] @ found[flat + 1 :]
        return found

    def errors(self, trained: np.ndarray, order: int, test: int) -> np.ndarray:
        """Squared position errors (rows, priors) in block ``test``, mm^2."""
        by_motion = np.empty_like(trained)
        by_motion[self._place(order)] = trained
        frames, rest = np.split(by_motion, [self.kept.shape[1]])
        vectors = np.concatenate([self.kept @ frames, rest])
        parts = [
            np.sum(applied(columns[:, :3], self._up_to(order, groups), vectors) ** 2, axis=1)
            for columns, groups in self.motions[test]
        ]
        return np.concatenate(parts)

    def _sums(self, order: int) -> dict[int, np.ndarray]:
        """By block the Gram matrix of ``[J | r]``, of ``order`` at least."""
        sizes = [len(each) for each in self._normal.values()]
        if not sizes or sizes[0] < self.flat + 1 + self.bent * order:
            built = min(_FIRST, self.empty.order) if order <= _FIRST else self.empty.order
            self._normal.clear()
            for number, parts in self.motions.items():
                self._normal[number] = self._summed(built, parts)
        return self._normal

    def _weighted(self, order: int, far: Mapping[int, np.ndarray]) -> np.ndarray | float:
        """Gram matrix of the rows of blocks, each times its share in ``far``; 0 for none."""
        parts = []
        for number, share in far.items():
            begin = 0
            for columns, groups in self.motions[number] if share.any() else ():
                own = share[begin : begin + len(columns)]
                begin += len(columns)
                rows = np.flatnonzero(own)
                if rows.size:
                    some = [
                        Group(each.columns, None if each.basis is None else each.basis[rows])
                        for each in groups
                    ]
                    parts.append((columns[rows] * np.sqrt(own[rows])[:, None, None], some))
        return self._summed(order, parts) if parts else 0.0

    def _summed(self, order: int, parts: Sequence[Motions]) -> np.ndarray:
        """Gram matrix of ``[J | r]`` of ``parts`` up to ``order``, in the order of unknowns."""
        total = 0.0
        for columns, groups in parts:
            total += gram(columns, self._up_to(order, groups))
        place = self._place(order)
        return _in(self.kept, total)[np.ix_(place, place)]

    def _up_to(self, order: int, groups: Sequence[Group]) -> list[Group]:
        """Groups of one block of motions without what is above ``order``."""
        joints = range(1, 1 + self.empty.joints)  # frames come first, then joint by joint
        return [
            Group(each.columns, each.basis[:, : order + 1]) if i in joints else each
            for i, each in enumerate(groups)
        ]

    def _place(self, order: int) -> np.ndarray:
        """Where unknowns (P,) are in a Gram matrix up to ``order``, which goes motion by motion."""
        terms = np.tile(np.arange(order + 1), self.bent)
        offsets = self.flat - self.kept.shape[1] - self.bent
        # The residual is the last column.
        degree = [np.zeros(self.kept.shape[1]), terms, np.zeros(offsets + 1)]
        return np.argsort(np.concatenate(degree), kind="stable")

    def _falling(self, prior: Prior, order: int) -> np.ndarray:
        """Prior standard deviations of unknowns above order 0, over that of a length; 1 before."""
        std = prior.std(self.empty)[: self.empty.coefficients.size].reshape(self.bent, -1)
        return np.append(1.0, std[:, 1 : order + 1].T / prior.delta_mm)


def _in(kept: np.ndarray, total: np.ndarray) -> np.ndarray:
    """A Gram matrix of motions and others, in coordinates with ``kept`` in place of the motions."""
    if np.array_equal(kept, np.eye(len(kept))):
        return total
    inner, size = kept.shape
    frames = kept.T @ total[:inner]
    found = np.empty((size + len(total) - inner,) * 2)
    found[:size, :size] = frames[:, :inner] @ kept
    found[:size, size:] = frames[:, inner:]
    found[size:, :size] = frames[:, inner:].T
    found[size:, size:] = total[inner:, inner:]
    return found
