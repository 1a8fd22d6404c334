"""LLVM instructions on vectors of lanes: a small assembler, and transcendental functions without branches.

Every operation is IEEE 754 double precision, and multiply-adds are fused only where they are asked for. The result in a
lane therefore does not depend on the number of lanes, and only through `library`, the C library's functions, on the
machine. The sign of a zero may differ from that of the C library.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence

#: Adding it rounds a number below 2^51 to the nearest integer, which then stands in the low bits.
_ROUND = 1.5 * 2.0**52
_LN2 = (math.log(2.0), 2.3190468138462996e-17)
_HALF_PI = (math.pi / 2, 6.123233995736766e-17)
#: SplitMix64: the step of its counter, and shifts and factors that mix it.
STRIDE, MIXES = 0x9E3779B97F4A7C15, ((30, 0xBF58476D1CE4E5B9), (27, 0x94D049BB133111EB))
#: tanh is 1 in double precision from here on.
_TANH_END = 20.0
#: Where exp is no normal number any more, and where it is infinite.
_EXP_END = (-708.0, math.log(1.7976931348623157e308))
#: The reduction of angles is exact as far as this; sin and cos are NaN beyond.
_ANGLE_END = 1e12


class Assembler:
    """Collects instructions; each method appends one operation on vectors of lanes and returns the name of its result.

    Args:
        lanes: Number of lanes; 1 makes scalar code of the same operations.
    """

    def __init__(self, lanes: int) -> None:
        self.lanes = lanes
        self.real = "double" if lanes == 1 else f"<{lanes} x double>"
        self.whole = "i64" if lanes == 1 else f"<{lanes} x i64>"
        self.truth = "i1" if lanes == 1 else f"<{lanes} x i1>"
        self.suffix = "f64" if lanes == 1 else f"v{lanes}f64"
        self.lines: list[str] = []
        self.pool: list[str] = []
        self.declared: set[str] = set()
        self._constants: dict[tuple[str, str], str] = {}
        self._count = 0

    def emit(self, text: str) -> str:
        """Append an instruction that has a result."""
        self._count += 1
        name = f"%v{self._count}"
        self.lines.append(f"  {name} = {text}")
        return name

    def write(self, text: str) -> None:
        """Append a line as it is."""
        self.lines.append(text)

    def label(self, stem: str) -> str:
        """A new label."""
        self._count += 1
        return f"{stem}{self._count}"

    def const(self, value: float) -> str:
        """A number in every lane."""
        return self._splat("double", f"0x{struct.unpack('<Q', struct.pack('<d', float(value)))[0]:016X}")

    def bits(self, value: int) -> str:
        """A 64-bit integer in every lane."""
        return self._splat("i64", str(value - 2**64 if value >= 2**63 else value))

    def _splat(self, kind: str, text: str) -> str:
        if self.lanes == 1:
            return text
        if (kind, text) not in self._constants:
            name = f"%c{len(self._constants)}"
            vector = f"<{self.lanes} x {kind}>"
            self.pool += [
                f"  {name}s = insertelement {vector} poison, {kind} {text}, i32 0",
                f"  {name} = shufflevector {vector} {name}s, {vector} poison, <{self.lanes} x i32> zeroinitializer",
            ]
            self._constants[kind, text] = name
        return self._constants[kind, text]

    def spread(self, scalar: str, kind: str = "double") -> str:
        """A scalar value in every lane."""
        if self.lanes == 1:
            return scalar
        vector = f"<{self.lanes} x {kind}>"
        first = self.emit(f"insertelement {vector} poison, {kind} {scalar}, i32 0")
        return self.emit(f"shufflevector {vector} {first}, {vector} poison, <{self.lanes} x i32> zeroinitializer")

    def add(self, a: str, b: str) -> str:
        """The sum."""
        return self.emit(f"fadd {self.real} {a}, {b}")

    def sub(self, a: str, b: str) -> str:
        """The difference."""
        return self.emit(f"fsub {self.real} {a}, {b}")

    def mul(self, a: str, b: str) -> str:
        """The product."""
        return self.emit(f"fmul {self.real} {a}, {b}")

    def div(self, a: str, b: str) -> str:
        """The quotient."""
        return self.emit(f"fdiv {self.real} {a}, {b}")

    def neg(self, a: str) -> str:
        """The opposite."""
        return self.emit(f"fneg {self.real} {a}")

    def fma(self, a: str, b: str, c: str) -> str:
        """``a b + c``, rounded once."""
        return self.intrinsic("fma", a, b, c)

    def intrinsic(self, name: str, *arguments: str) -> str:
        """An LLVM intrinsic on vectors of lanes, such as fma, fabs, sqrt or floor."""
        full = f"@llvm.{name}.{self.suffix}"
        self.declared.add(f"declare {self.real} {full}({', '.join([self.real] * len(arguments))})")
        return self.emit(f"call {self.real} {full}({', '.join(f'{self.real} {a}' for a in arguments)})")

    def library(self, name: str, *arguments: str) -> str:
        """A function of the C library, lane by lane."""
        self.declared.add(f"declare double @{name}({', '.join(['double'] * len(arguments))}) memory(none)")
        if self.lanes == 1:
            return self.emit(f"call double @{name}({', '.join(f'double {a}' for a in arguments)})")
        result = "poison"
        for lane in range(self.lanes):
            parts = [self.emit(f"extractelement {self.real} {a}, i32 {lane}") for a in arguments]
            value = self.emit(f"call double @{name}({', '.join(f'double {p}' for p in parts)})")
            result = self.emit(f"insertelement {self.real} {result}, double {value}, i32 {lane}")
        return result

    def compare(self, condition: str, a: str, b: str) -> str:
        """A truth value in every lane; conditions as in LLVM's fcmp."""
        return self.emit(f"fcmp {condition} {self.real} {a}, {b}")

    def select(self, truth: str, a: str, b: str) -> str:
        """A where true, else b."""
        return self.emit(f"select {self.truth} {truth}, {self.real} {a}, {self.real} {b}")

    def integer(self, operation: str, a: str, b: str) -> str:
        """An operation on 64-bit integers, such as add, mul, xor, shl or lshr."""
        return self.emit(f"{operation} {self.whole} {a}, {b}")

    def as_bits(self, a: str) -> str:
        """The bits of a number."""
        return self.emit(f"bitcast {self.real} {a} to {self.whole}")

    def as_real(self, a: str) -> str:
        """The number of some bits."""
        return self.emit(f"bitcast {self.whole} {a} to {self.real}")

    def polynomial(self, x: str, coefficients: Sequence[float]) -> str:
        """Σ coefficients[n] x^n by Estrin's scheme, fused: shorter chains than Horner's rule."""
        terms = [self.const(c) for c in coefficients]
        while len(terms) > 1:
            pairs = [self.fma(b, x, a) for a, b in zip(terms[::2], terms[1::2], strict=False)]
            terms = [*pairs, terms[-1]] if len(terms) % 2 else pairs
            x = self.mul(x, x)
        return terms[0]

    def sign(self, x: str) -> str:
        """-1, 1, or x itself where it is zero or NaN."""
        negative = self.select(self.compare("olt", x, self.const(0.0)), self.const(-1.0), x)
        return self.select(self.compare("ogt", x, self.const(0.0)), self.const(1.0), negative)

    def _power_of_two(self, x: str, bias: int) -> tuple[str, str]:
        """2^(k + bias - 1023) and e^r - 1 with x = k ln 2 + r."""
        magic = self.const(_ROUND)
        shifted = self.fma(x, self.const(1 / _LN2[0]), magic)
        k = self.sub(shifted, magic)
        r = self.fma(k, self.const(-_LN2[0]), x)
        r = self.fma(k, self.const(-_LN2[1]), r)
        # the low bits of `shifted` hold k: moved to the place of the exponent
        moved = self.integer("shl", self.as_bits(shifted), self.bits(52))
        scale = self.as_real(self.integer("add", moved, self.bits(bias << 52)))
        series = self.polynomial(r, [1 / math.factorial(n) for n in range(2, 14)])
        return scale, self.fma(self.mul(r, r), series, r)

    def exp(self, x: str) -> str:
        """Within 2e-15, relative; 0 below -708, where it is no normal number any more, infinite beyond 709.78."""
        scale, rest = self._power_of_two(x, 0x3FE)
        value = self.mul(self.fma(scale, rest, scale), self.const(2.0))
        value = self.select(self.compare("ogt", x, self.const(_EXP_END[1])), self.const(math.inf), value)
        return self.select(self.compare("olt", x, self.const(_EXP_END[0])), self.const(0.0), value)

    def tanh(self, x: str) -> str:
        """Within 2e-15, relative: (e^2|x| - 1) / (e^2|x| + 1) with the difference kept exact near 0."""
        size = self.intrinsic("fabs", x)
        end = self.const(_TANH_END)
        size = self.select(self.compare("ogt", size, end), end, size)
        scale, rest = self._power_of_two(self.add(size, size), 0x3FF)
        less_one = self.fma(scale, rest, self.sub(scale, self.const(1.0)))
        return self.intrinsic("copysign", self.div(less_one, self.add(less_one, self.const(2.0))), x)

    def sin(self, x: str) -> str:
        """Within 2e-15, absolute; NaN for |x| beyond 1e12."""
        return self._circular(x, 0)

    def cos(self, x: str) -> str:
        """Within 2e-15, absolute; NaN for |x| beyond 1e12."""
        return self._circular(x, 1)

    def _circular(self, x: str, quarter: int) -> str:
        """sin(x + quarter π/2); the reduction is the same for both, so that it is made once where both are asked."""
        magic = self.const(_ROUND)
        shifted = self.fma(x, self.const(1 / _HALF_PI[0]), magic)
        k = self.sub(shifted, magic)
        r = self.fma(k, self.const(-_HALF_PI[0]), x)
        r = self.fma(k, self.const(-_HALF_PI[1]), r)
        square = self.mul(r, r)
        odd = self.polynomial(square, [(-1) ** n / math.factorial(2 * n + 1) for n in range(1, 9)])
        even = self.polynomial(square, [(-1) ** n / math.factorial(2 * n) for n in range(1, 9)])
        sine = self.fma(self.mul(r, square), odd, r)
        cosine = self.fma(square, even, self.const(1.0))
        turn = self.as_bits(shifted)
        if quarter:
            turn = self.integer("add", turn, self.bits(quarter))
        odd_turn = self.integer("shl", turn, self.bits(63))
        swap = self.emit(f"icmp ne {self.whole} {odd_turn}, {self.bits(0)}")
        value = self.select(swap, cosine, sine)
        sign = self.integer("and", self.integer("shl", turn, self.bits(62)), self.bits(1 << 63))
        value = self.as_real(self.integer("xor", self.as_bits(value), sign))
        inside = self.compare("ole", self.intrinsic("fabs", x), self.const(_ANGLE_END))
        return self.select(inside, value, self.const(math.nan))

    def mixed(self, seed: str, counter: str) -> str:
        """64 random bits from a seed and a counter: SplitMix64 (Steele, Lea and Flood 2014)."""
        z = self.integer("add", seed, self.integer("mul", counter, self.bits(STRIDE)))
        for shift, factor in MIXES:
            z = self.integer(
                "mul", self.integer("xor", z, self.integer("lshr", z, self.bits(shift))), self.bits(factor)
            )
        return self.integer("xor", z, self.integer("lshr", z, self.bits(31)))

    def uniform(self, seed: str, counter: str) -> str:
        """A uniform draw from [-1, 1) with 52 bits."""
        mantissa = self.integer("lshr", self.mixed(seed, counter), self.bits(12))
        in_one_two = self.as_real(self.integer("or", mantissa, self.bits(0x3FF << 52)))
        return self.fma(in_one_two, self.const(2.0), self.const(-3.0))
