"""Bit-level primitives of the deterministic elementary functions.

Everything here compiles to plain integer or IEEE 754 instructions, on every processor, with no
library call. The intrinsics exist because the ordinary spellings do not: in numba `math.frexp`,
`math.ldexp` and `math.sqrt` call libm, `math.floor` does where there is no SSE4.1, and a `>>` on
a signed integer is arithmetic.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import njit, types
from numba.extending import intrinsic

#: 1.5 * 2**52. Adding it rounds to the nearest integer, leaves that integer in the low bits (two's
#: complement) and needs no rounding instruction. Valid for magnitudes below 2**51.
ROUND_MAGIC = 6755399441055744.0

#: Keeps the top 26 significand bits: the product of two such numbers is exact.
_SPLIT_MASK = -(1 << 27)

_SIGN_BIT = -(1 << 63)

#: Untyped on purpose: numba's annotation counts the typing context as an argument of calls. What is
#: made with it gets its type below.
_intrinsic: Any = intrinsic

_Codegen = tuple[Any, Callable[..., Any]]


def _float_bits(typingctx: Any, x: Any) -> _Codegen:
    """Return the IEEE 754 pattern of a float64 as int64 (an LLVM bitcast)."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.bitcast(args[0], ir.IntType(64))

    return types.int64(types.float64), codegen


float_bits: Callable[[float], int] = _intrinsic(_float_bits)


def _from_bits(typingctx: Any, bits: Any) -> _Codegen:
    """Return the float64 whose IEEE 754 pattern is the int64 `bits` (an LLVM bitcast)."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.bitcast(args[0], ir.DoubleType())

    return types.float64(types.int64), codegen


from_bits: Callable[[int], float] = _intrinsic(_from_bits)


def _shift_right(typingctx: Any, bits: Any, count: Any) -> _Codegen:
    """Return `bits` shifted right with zeros shifted in; `count` is 0 to 63."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.lshr(args[0], args[1])

    return types.int64(types.int64, types.int64), codegen


shift_right: Callable[[int, int], int] = _intrinsic(_shift_right)


def _mul_high(typingctx: Any, a: Any, b: Any) -> _Codegen:
    """Return the upper 64 bits of the 128-bit product of two unsigned 64-bit patterns."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        wide = ir.IntType(128)
        product = builder.mul(builder.zext(args[0], wide), builder.zext(args[1], wide))
        return builder.trunc(builder.lshr(product, wide(64)), ir.IntType(64))

    return types.int64(types.int64, types.int64), codegen


mul_high: Callable[[int, int], int] = _intrinsic(_mul_high)


def _square_root(typingctx: Any, x: Any) -> _Codegen:
    """Return the correctly rounded square root, NaN below zero (an LLVM intrinsic).

    It is one instruction on x86-64 and aarch64, where numba's `math.sqrt` calls libm.
    """

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.call(builder.module.declare_intrinsic("llvm.sqrt", [args[0].type]), args)

    return types.float64(types.float64), codegen


square_root: Callable[[float], float] = _intrinsic(_square_root)


@njit(cache=True, error_model="numpy")
def carry_out(total: int, addend: int) -> int:
    """Return 1 if the unsigned 64-bit sum `total` = `addend` + something wrapped, else 0."""
    return 1 if (total ^ _SIGN_BIT) < (addend ^ _SIGN_BIT) else 0


@njit(cache=True, error_model="numpy")
def split_high(x: float) -> float:
    """Return `x` truncated to 26 significand bits; `x` minus it is exact and has at most 27."""
    return from_bits(float_bits(x) & _SPLIT_MASK)


@njit(cache=True, error_model="numpy")
def two_sum(a: float, b: float) -> tuple[float, float]:
    """Return the rounded sum of `a` and `b` and its exact error (Knuth, any order)."""
    s = a + b
    t = s - a
    return s, (a - (s - t)) + (b - t)


@njit(cache=True, error_model="numpy")
def two_product(a: float, b: float) -> tuple[float, float]:
    """Return the rounded product of `a` and `b` and its error, good to 2**-106 of the product.

    Dekker's product with a truncating split, which unlike Veltkamp's cannot overflow. There is no
    fused multiply-add: its use must not depend on the processor.
    """
    p = a * b
    ah = split_high(a)
    al = a - ah
    bh = split_high(b)
    bl = b - bh
    return p, (((ah * bh - p) + ah * bl) + al * bh) + al * bl


@njit(cache=True, error_model="numpy")
def quotient_tail(num: float, q: float, den: float, recip: float) -> float:
    """Return what `q` = fl(`num`/`den`) lacks of the true quotient; `recip` is about 1/`den`.

    The caller computes `recip` beside `q`, so that the two divisions overlap.
    """
    qh = split_high(q)
    dh = split_high(den)
    rest = ((num - qh * dh) - qh * (den - dh)) - (q - qh) * den
    return rest * recip


@njit(cache=True, error_model="numpy")
def power_of_two(n: int) -> float:
    """Return 2**n for -1022 <= n <= 1023."""
    return from_bits((n + 1023) << 52)
