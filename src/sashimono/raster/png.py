"""PNG files, written without a library."""

from __future__ import annotations

import struct
import zlib

import numpy as np
from jaxtyping import UInt8


def png_bytes(pixels: UInt8[np.ndarray, "row column 3"]) -> bytes:
    """Return an sRGB image as a PNG file (ISO/IEC 15948): 8 bits a channel, each row less the one above it."""
    rows, columns, _ = pixels.shape
    flat = pixels.reshape(rows, 3 * columns)
    above = np.concatenate([np.zeros((1, 3 * columns), dtype=np.uint8), flat[:-1]])
    lines = np.concatenate([np.full((rows, 1), 2, dtype=np.uint8), flat - above], axis=1)  # 2: the filter "up"
    header = struct.pack(">IIBBBBB", columns, rows, 8, 2, 0, 0, 0)
    body = _chunk(b"IHDR", header) + _chunk(b"IDAT", zlib.compress(lines.tobytes(), 9)) + _chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + body


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
