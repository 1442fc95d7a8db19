"""Compression of chunks: the three that the MCAP registry knows."""

from __future__ import annotations

from typing import Final, Literal, cast

import lz4.frame
import zstandard

Compression = Literal["lz4", "zstd", "none"]
# MCAP's name of each; no compression is the empty text.
WIRE_NAMES: Final[dict[Compression, str]] = {"lz4": "lz4", "zstd": "zstd", "none": ""}
# Above this a chunk is taken for damage rather than for data.
MAX_CHUNK_BYTES: Final = 1 << 32
_ZSTD_LEVEL: Final = 1


class ChunkError(ValueError):
    """The records of a chunk cannot be had."""


class Compressor:
    """Compresses chunks, one after the other.

    Parameters
    ----------
    compression : "lz4", "zstd" or "none"
    """

    def __init__(self, compression: Compression) -> None:
        self.name = WIRE_NAMES[compression]
        self._zstd = zstandard.ZstdCompressor(level=_ZSTD_LEVEL)

    def __call__(self, plain: bytes | memoryview) -> bytes | memoryview:
        """Records of a chunk to what the file holds."""
        if self.name == "lz4":
            size = lz4.frame.BLOCKSIZE_MAX4MB
            return cast(bytes, lz4.frame.compress(plain, block_size=size))
        return self._zstd.compress(plain) if self.name == "zstd" else plain


def decompress(compression: str, data: memoryview, size: int) -> bytes | memoryview:
    """Records of a chunk.

    Parameters
    ----------
    compression : str
        As the chunk names it.
    data : memoryview
        What the file holds.
    size : int
        Bytes that must come out.

    Raises
    ------
    ChunkError
        Where the compression is unknown, or not exactly `size` bytes come out.
    """
    if size > MAX_CHUNK_BYTES:
        raise ChunkError(f"{size} bytes are more than a chunk can have")
    if compression == "":
        plain: bytes | memoryview = data
    elif compression == "lz4":
        plain = _lz4(data, size)
    elif compression == "zstd":
        plain = _zstd(data, size)
    else:
        raise ChunkError(f"the compression {compression!r} is unknown")
    if len(plain) != size:
        raise ChunkError(f"{len(plain)} bytes came out where {size} are due")
    return plain


def _lz4(data: memoryview, size: int) -> bytes:
    try:
        decompressor = lz4.frame.LZ4FrameDecompressor()
        # One byte more than is due, so that a frame that holds more is found and
        # one that is damaged into holding terabytes stops.
        return cast(bytes, decompressor.decompress(data, max_length=size + 1))
    except (RuntimeError, ValueError, EOFError) as error:
        raise ChunkError(f"lz4 says: {error}") from error


def _zstd(data: memoryview, size: int) -> bytes:
    try:
        # A frame need not state its size; then the chunk's own is the limit.
        stated = zstandard.frame_content_size(data)
        if stated >= 0 and stated != size:
            raise ChunkError(f"the frame says {stated} bytes where {size} are due")
        return zstandard.ZstdDecompressor().decompress(data, max_output_size=size)
    except zstandard.ZstdError as error:
        raise ChunkError(f"zstd says: {error}") from error
