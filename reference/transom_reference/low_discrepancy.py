"""Random numbers in [0, 1) for paths: scrambled, shuffled Sobol' pairs, one hash per lane, batch and dimension.

Each pair of dimensions is an independently Owen-scrambled (0, 2)-net over the samples of one batch, so a batch is an
unbiased estimate by itself and batches with different seeds are independent.
[Burley 2020, Practical hash-based Owen scrambling, JCGT 9(4); permutation by Vegdahl 2021]
"""

from __future__ import annotations

from typing import Any

from transom_reference.mitsuba_setup import dr, mi


def mix(value: Any) -> Any:
    """A hash of 32-bit integers with good avalanche (constants: Wellons' triple32 search, two rounds)."""
    value = value ^ (value >> 16)
    value = value * mi.UInt32(0x21F0AAAD)
    value = value ^ (value >> 15)
    value = value * mi.UInt32(0xD35A2D97)
    return value ^ (value >> 15)


def lane_seed(lane: Any, seed: Any) -> Any:
    """Hash of a lane (pixel or sensor) and a batch's seed: the start of every number of that lane."""
    return mix(lane ^ mix(seed + mi.UInt32(0x68BC21EB)))


def _laine_karras(value: Any, seed: Any) -> Any:
    """Owen scrambling of a bit-reversed integer: each bit is flipped by a hash of the bits below it."""
    value = value + seed
    value = value ^ (value * mi.UInt32(0x6C50B47C))
    value = value ^ (value * mi.UInt32(0xB82F1E52))
    value = value ^ (value * mi.UInt32(0xC7AFE638))
    return value ^ (value * mi.UInt32(0x8D22F6E6))


def _unit(value: Any) -> Any:
    return mi.Float(value >> 8) * (1.0 / 16777216.0)


def pair(seed: Any, dimension: Any, index: Any, log2_count: int) -> tuple[Any, Any]:
    """Two numbers of sample `index` (0 .. 2^log2_count - 1) for a lane's `seed` and a pair number `dimension`."""
    key = mix(seed + dimension * mi.UInt32(0x9E3779B9))
    if log2_count > 0:
        # Nested shuffle inside the batch: scramble the index as a binary fraction of log2_count bits.
        shuffled = dr.brev(_laine_karras(dr.brev(index << (32 - log2_count)), key)) >> (32 - log2_count)
    else:
        shuffled = index
    second = mi.UInt32(0)
    direction = 1 << 31
    for bit in range(log2_count):
        second = second ^ dr.select((shuffled & (1 << bit)) != 0, mi.UInt32(direction), mi.UInt32(0))
        direction ^= direction >> 1
    x_key = mix(key ^ mi.UInt32(0xA511E9B3))
    y_key = mix(key ^ mi.UInt32(0x63D83595))
    x = dr.brev(_laine_karras(shuffled, x_key))
    y = dr.brev(_laine_karras(dr.brev(second), y_key))
    return _unit(x), _unit(y)
