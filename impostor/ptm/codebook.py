"""A PTM by vector quantisation: small codes a texel, and tables small enough for the GPU to look them up."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.cluster.vq import kmeans2
from scipy.spatial import KDTree

from impostor.errors import SettingsError
from impostor.ptm.mipmaps import light_gram
from impostor.ptm.polynomials import TERMS, Polynomials

# The even terms and the odd ones of a polynomial do not correlate over the lights, so that the error of one is never
# made good or worse by the other's: each gets a table of its own.
EVEN, ODD = (0, 1, 2, 5), (3, 4)
MOST_ENTRIES = 65536
SAMPLE = 32768  # texels that the entries are found from
ITERATIONS = 15


@dataclass(frozen=True, eq=False)
class Codebook:
    """A PTM as codes into tables.

    Parameters
    ----------
    tables : tuple of ndarray, each of shape (K, D), float32
        Entries: the terms 0, 1, 2, 5 of all polynomials of a texel, then its terms 3, 4; then its color or chroma,
        where it has any.
    codes : ndarray of shape (H, W, T), uint8 or uint16
        Which entry of each table; uint8 where no table has more than 256.
    like : Polynomials
        One texel of the PTM, for what all texels share.

    References
    ----------
    HPL-2004-225, "Light-Dependent Texture Mapping and Beyond": "vector quantization can be implemented directly on the
    GPU".
    """

    tables: tuple[NDArray[np.float32], ...]
    codes: NDArray[np.unsignedinteger]
    like: Polynomials

    def polynomials(self) -> Polynomials:
        """The PTM that the codes stand for."""
        height, width, _ = self.codes.shape
        parts = [table[self.codes[..., index]] for index, table in enumerate(self.tables)]
        count = self.like.coefficients.shape[2]
        coefficients = np.empty((height, width, count, TERMS), np.float32)
        coefficients[..., EVEN] = parts[0].reshape(height, width, count, -1)
        coefficients[..., ODD] = parts[1].reshape(height, width, count, -1)
        color = None if self.like.color is None else parts[2]
        chroma = None if self.like.chroma is None else parts[2]
        return replace(self.like, coefficients=coefficients, color=color, chroma=chroma)

    @property
    def bytes(self) -> int:
        """What codes and tables take in memory, tables in half floats."""
        return self.codes.nbytes + 2 * sum(table.size for table in self.tables)


def make_codebook(polynomials: Polynomials, entries: int = 256, seed: int = 0) -> Codebook:
    """Find the tables and codes of a PTM by k-means.

    Parameters
    ----------
    polynomials : Polynomials
    entries : int
        Of each table, 1..65536; fewer where the PTM has no more different texels.
    seed : int
        The same seed gives the same codebook.

    Returns
    -------
    Codebook

    Raises
    ------
    SettingsError
        `entries` is out of range.

    Notes
    -----
    Distances between polynomials are mean squared differences of their values over all light directions. Where the
    luminance multiplies a color, both count by what they do to the product at the texel's mean brightness.
    """
    if not 1 <= entries <= MOST_ENTRIES:
        raise SettingsError("codebook", f"{entries} entries; expected 1 to {MOST_ENTRIES}")
    random = np.random.default_rng(seed)
    coefficients = polynomials.coefficients
    texels = coefficients.shape[0] * coefficients.shape[1]
    vectors = [coefficients[..., terms].reshape(texels, -1) for terms in (EVEN, ODD)]
    metrics = [_metric(terms, coefficients.shape[2]) for terms in (EVEN, ODD)]
    weights = [np.ones(texels)] * 2
    constant = polynomials.color if polynomials.color is not None else polynomials.chroma
    if constant is not None:
        vectors.append(constant.reshape(texels, -1))
        metrics.append(np.eye(constant.shape[2]))
        weights.append(np.ones(texels))
    if polynomials.color is not None:
        weights[:2] = [np.square(polynomials.color, dtype=np.float64).sum(axis=-1).ravel()] * 2
        weights[2] = np.square(coefficients.reshape(texels, TERMS) @ light_gram()[-1])
    made = [_table(*parts, entries, random) for parts in zip(vectors, metrics, weights, strict=True)]
    codes = np.stack([code for _, code in made], axis=-1).reshape(*coefficients.shape[:2], -1)
    dtype = np.uint8 if max(len(table) for table, _ in made) <= 256 else np.uint16
    return Codebook(tuple(table for table, _ in made), codes.astype(dtype), _one_texel(polynomials))


def _metric(terms: tuple[int, ...], polynomials: int) -> NDArray[np.float64]:
    """What turns coefficients into vectors whose distance is that of values over all lights."""
    gram = light_gram()[np.ix_(terms, terms)]
    return np.kron(np.eye(polynomials), np.linalg.cholesky(gram)).astype(np.float64)


def _table(
    vectors: NDArray[np.float32],
    metric: NDArray[np.float64],
    weights: NDArray[np.float64],
    entries: int,
    random: np.random.Generator,
) -> tuple[NDArray[np.float32], NDArray[np.intp]]:
    """Entries (K, D) and the code (N,) of every vector (N, D)."""
    points = vectors @ metric
    # Drawing texels by weight is what weighs them in the means.
    chances = (weights + 1e-12) / (weights + 1e-12).sum()
    sample = points[random.choice(len(points), min(SAMPLE, 4 * len(points)), p=chances)]
    distinct = np.unique(points if len(points) <= SAMPLE else sample, axis=0)
    centers = random.permutation(distinct)[:entries]
    if len(centers) < len(distinct):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of an entry that no texel of the sample is nearest to
            centers, _ = kmeans2(sample, centers, ITERATIONS, minit="matrix")
    _, codes = KDTree(centers).query(points)
    table = np.linalg.solve(metric.T, centers.T).T
    return table.astype(np.float32), np.asarray(codes, np.intp)


def _one_texel(polynomials: Polynomials) -> Polynomials:
    color, chroma = (None if array is None else array[:1, :1] for array in (polynomials.color, polynomials.chroma))
    return replace(polynomials, coefficients=polynomials.coefficients[:1, :1], color=color, chroma=chroma)
