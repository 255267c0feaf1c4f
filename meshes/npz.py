"""Named arrays as the bytes of NumPy's .npz format and back; pickles are neither written nor read."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray


def to_npz(arrays: Mapping[str, NDArray[Any]]) -> bytes:
    """Bytes of a compressed .npz file; the same for equal arrays, since no time of day is in them.

    Raises
    ------
    ValueError
        An array of objects.
    """
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, array in arrays.items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as file:
                np.lib.format.write_array(file, np.asarray(array), allow_pickle=False)
    return buffer.getvalue()


def from_npz(content: bytes) -> dict[str, NDArray[Any]]:
    """Arrays of a .npz file.

    Raises
    ------
    ValueError
        Anything that is no whole .npz file of plain arrays.
    """
    try:
        with np.load(io.BytesIO(content), allow_pickle=False) as file:
            return {name: np.asarray(file[name]) for name in file.files}
    except Exception as error:  # zip, zlib and NumPy's parser each raise their own, and a lone array is no archive
        raise ValueError(f"{type(error).__name__}: {error}") from error
