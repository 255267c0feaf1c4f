"""The tool flange settles: the tool yields along the force, by a length that saturates."""

import numpy as np

from fem.effects import Effect, EffectParameter

SETTLING = EffectParameter("settling", "length", "um", 5e-6, 80e-6, source="own trial, three flanges")
FORCE = EffectParameter("force", "force", "N", 50.0, 500.0, source="own trial", role="shape", grid=(50.0, 150.0, 500.0))


def law(_, situation, v):
    """Displacement s (1 - exp(-F/F0)) along the force; v = (s, F0) in SI, one row a reading."""
    force = situation.at.wrench[:, :3]
    size = np.linalg.norm(force, axis=1, keepdims=True)
    way = force / np.maximum(size, 1e-9)
    d = np.zeros((len(force), 6))
    d[:, :3] = v[0] * (1.0 - np.exp(-size / v[1])) * way
    return d


def effects(model):
    """What stiffarm asks for: the effects that this arm can have."""
    words = "the tool flange settles under load"
    return [Effect("flange-settling", words, "arm", (SETTLING, FORCE), law, family="flange-settling")]
