"""Unaligned loads, stores and copies for compiled loops over bytes.

A loop that builds a 64-bit word from eight indexed bytes is not merged into one
load, because numba's indexing allows negative numbers; these are plain pointer
operations. None of them checks bounds: whoever calls must have.
Byte order is the machine's, which is little on every platform supported here.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

_Codegen = tuple[Any, Callable[..., Any]]
_WORD: dict[int, Any] = {64: types.uint64, 32: types.uint32, 16: types.uint16}
_void: Any = types.void
_copy: Any = cgutils.raw_memcpy


def _pointer(context: Any, builder: Any, array_type: Any, array: Any, offset: Any) -> Any:
    data = context.make_array(array_type)(context, builder, array).data
    return builder.gep(data, [offset])


def _load(buf: Any, offset: Any, bits: int) -> _Codegen:
    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        pointer = _pointer(context, builder, signature.args[0], args[0], args[1])
        word = builder.bitcast(pointer, ir.IntType(bits).as_pointer())
        return builder.load(word, align=1)

    return _WORD[bits](buf, types.int64), codegen


def _store(buf: Any, offset: Any, value: Any, bits: int) -> _Codegen:
    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        pointer = _pointer(context, builder, signature.args[0], args[0], args[1])
        word = builder.bitcast(pointer, ir.IntType(bits).as_pointer())
        builder.store(args[2], word, align=1)
        return context.get_dummy_value()

    return _void(buf, types.int64, _WORD[bits]), codegen


def _load64(typingctx: Any, buf: Any, offset: Any) -> _Codegen:
    """Eight bytes of a uint8 array as uint64."""
    return _load(buf, offset, 64)


def _load32(typingctx: Any, buf: Any, offset: Any) -> _Codegen:
    """Four bytes of a uint8 array as uint32."""
    return _load(buf, offset, 32)


def _load16(typingctx: Any, buf: Any, offset: Any) -> _Codegen:
    """Two bytes of a uint8 array as uint16."""
    return _load(buf, offset, 16)


def _store64(typingctx: Any, buf: Any, offset: Any, value: Any) -> _Codegen:
    """Write a uint64 into eight bytes of a uint8 array."""
    return _store(buf, offset, value, 64)


def _store32(typingctx: Any, buf: Any, offset: Any, value: Any) -> _Codegen:
    """Write a uint32 into four bytes of a uint8 array."""
    return _store(buf, offset, value, 32)


def _store16(typingctx: Any, buf: Any, offset: Any, value: Any) -> _Codegen:
    """Write a uint16 into two bytes of a uint8 array."""
    return _store(buf, offset, value, 16)


def _copy_bytes(
    typingctx: Any, target: Any, target_at: Any, source: Any, source_at: Any, count: Any
) -> _Codegen:
    """Copy `count` bytes between two uint8 arrays that do not overlap."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        to = _pointer(context, builder, signature.args[0], args[0], args[1])
        of = _pointer(context, builder, signature.args[2], args[2], args[3])
        _copy(builder, to, of, args[4], 1)
        return context.get_dummy_value()

    return _void(target, types.int64, source, types.int64, types.int64), codegen


# As the compiler's decorators are typed, a call would have to give the typing context too.
load64: Any = intrinsic(_load64)
load32: Any = intrinsic(_load32)
load16: Any = intrinsic(_load16)
store64: Any = intrinsic(_store64)
store32: Any = intrinsic(_store32)
store16: Any = intrinsic(_store16)
copy_bytes: Any = intrinsic(_copy_bytes)
# int64, typed such that offsets stay plain numbers to the type checker.
signed: Any = np.int64
