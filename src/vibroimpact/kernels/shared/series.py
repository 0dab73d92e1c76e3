"""Power series of a step: tuples of the derivatives 0 to 20 at its beginning, with every operation written out.

A tuple lives in registers, for all lanes at once; a loop over its places would send it through memory. Derivatives are
b, coefficients b_j/j! are a.
"""

from __future__ import annotations

from vibroimpact.kernels.shared.machine import inner
from vibroimpact.kernels.shared.vectors import fma, get, put, select

# A step is at most REACH radians of the fastest rate; what the series leaves out is some REACH^21/21! = 5e-18 of the
# motion's size.
DEGREE, REACH = 20, 1.3
SIZE = DEGREE + 1


@inner(forceinline=True)
def oscillation(b0, b1, K, C, f):
    """Return b0, b1 and the derivatives of b'' = f - K b - C b'."""
    b2 = fma(-C, b1, fma(-K, b0, f[0]))
    b3 = fma(-C, b2, fma(-K, b1, f[1]))
    b4 = fma(-C, b3, fma(-K, b2, f[2]))
    b5 = fma(-C, b4, fma(-K, b3, f[3]))
    b6 = fma(-C, b5, fma(-K, b4, f[4]))
    b7 = fma(-C, b6, fma(-K, b5, f[5]))
    b8 = fma(-C, b7, fma(-K, b6, f[6]))
    b9 = fma(-C, b8, fma(-K, b7, f[7]))
    b10 = fma(-C, b9, fma(-K, b8, f[8]))
    b11 = fma(-C, b10, fma(-K, b9, f[9]))
    b12 = fma(-C, b11, fma(-K, b10, f[10]))
    b13 = fma(-C, b12, fma(-K, b11, f[11]))
    b14 = fma(-C, b13, fma(-K, b12, f[12]))
    b15 = fma(-C, b14, fma(-K, b13, f[13]))
    b16 = fma(-C, b15, fma(-K, b14, f[14]))
    b17 = fma(-C, b16, fma(-K, b15, f[15]))
    b18 = fma(-C, b17, fma(-K, b16, f[16]))
    b19 = fma(-C, b18, fma(-K, b17, f[17]))
    b20 = fma(-C, b19, fma(-K, b18, f[18]))
    return b0, b1, b2, b3, b4, b5, b6, b7, b8, b9, b10, b11, b12, b13, b14, b15, b16, b17, b18, b19, b20


@inner(forceinline=True)
def wave(b0, b1, q):
    """Return the derivatives of a sine, from its value and its rate; q = -theta^2."""
    b2 = q * b0
    b3 = q * b1
    b4 = q * b2
    b5 = q * b3
    b6 = q * b4
    b7 = q * b5
    b8 = q * b6
    b9 = q * b7
    b10 = q * b8
    b11 = q * b9
    b12 = q * b10
    b13 = q * b11
    b14 = q * b12
    b15 = q * b13
    b16 = q * b14
    b17 = q * b15
    b18 = q * b16
    b19 = q * b17
    b20 = q * b18
    return b0, b1, b2, b3, b4, b5, b6, b7, b8, b9, b10, b11, b12, b13, b14, b15, b16, b17, b18, b19, b20


@inner(forceinline=True)
def plus(a, b):
    """Return a + b."""
    return (
        a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3], a[4] + b[4], a[5] + b[5], a[6] + b[6], a[7] + b[7],
        a[8] + b[8], a[9] + b[9], a[10] + b[10], a[11] + b[11], a[12] + b[12], a[13] + b[13], a[14] + b[14],
        a[15] + b[15], a[16] + b[16], a[17] + b[17], a[18] + b[18], a[19] + b[19], a[20] + b[20]
    )  # fmt: skip


@inner(forceinline=True)
def plus_times(a, t, b):
    """Return a + t b."""
    return (
        fma(t, b[0], a[0]), fma(t, b[1], a[1]), fma(t, b[2], a[2]), fma(t, b[3], a[3]), fma(t, b[4], a[4]),
        fma(t, b[5], a[5]), fma(t, b[6], a[6]), fma(t, b[7], a[7]), fma(t, b[8], a[8]), fma(t, b[9], a[9]),
        fma(t, b[10], a[10]), fma(t, b[11], a[11]), fma(t, b[12], a[12]), fma(t, b[13], a[13]), fma(t, b[14], a[14]),
        fma(t, b[15], a[15]), fma(t, b[16], a[16]), fma(t, b[17], a[17]), fma(t, b[18], a[18]), fma(t, b[19], a[19]),
        fma(t, b[20], a[20])
    )  # fmt: skip


@inner(forceinline=True)
def times(b, t):
    """Return t b."""
    return (
        t * b[0], t * b[1], t * b[2], t * b[3], t * b[4], t * b[5], t * b[6], t * b[7], t * b[8], t * b[9], t * b[10],
        t * b[11], t * b[12], t * b[13], t * b[14], t * b[15], t * b[16], t * b[17], t * b[18], t * b[19], t * b[20]
    )  # fmt: skip


@inner(forceinline=True)
def coefficients(b):
    """Return the coefficients b_j/j!."""
    return (
        b[0] * 1.0, b[1] * 1.0, b[2] * 0.5, b[3] * 0.16666666666666666, b[4] * 0.041666666666666664,
        b[5] * 0.008333333333333333, b[6] * 0.001388888888888889, b[7] * 0.0001984126984126984,
        b[8] * 2.48015873015873e-05, b[9] * 2.7557319223985893e-06, b[10] * 2.755731922398589e-07,
        b[11] * 2.505210838544172e-08, b[12] * 2.08767569878681e-09, b[13] * 1.6059043836821613e-10,
        b[14] * 1.1470745597729725e-11, b[15] * 7.647163731819816e-13, b[16] * 4.779477332387385e-14,
        b[17] * 2.8114572543455206e-15, b[18] * 1.5619206968586225e-16, b[19] * 8.22063524662433e-18,
        b[20] * 4.110317623312165e-19
    )  # fmt: skip


@inner(forceinline=True)
def either(truth, a, b):
    """Return a where `truth` holds, else b."""
    return (
        select(truth, a[0], b[0]), select(truth, a[1], b[1]), select(truth, a[2], b[2]), select(truth, a[3], b[3]),
        select(truth, a[4], b[4]), select(truth, a[5], b[5]), select(truth, a[6], b[6]), select(truth, a[7], b[7]),
        select(truth, a[8], b[8]), select(truth, a[9], b[9]), select(truth, a[10], b[10]), select(truth, a[11], b[11]),
        select(truth, a[12], b[12]), select(truth, a[13], b[13]), select(truth, a[14], b[14]),
        select(truth, a[15], b[15]), select(truth, a[16], b[16]), select(truth, a[17], b[17]),
        select(truth, a[18], b[18]), select(truth, a[19], b[19]), select(truth, a[20], b[20])
    )  # fmt: skip


@inner(forceinline=True)
def load(rows, first, wide):
    """Return the numbers in rows from the first on."""
    return (
        get(rows, first + 0, wide), get(rows, first + 1, wide), get(rows, first + 2, wide), get(rows, first + 3, wide),
        get(rows, first + 4, wide), get(rows, first + 5, wide), get(rows, first + 6, wide), get(rows, first + 7, wide),
        get(rows, first + 8, wide), get(rows, first + 9, wide), get(rows, first + 10, wide),
        get(rows, first + 11, wide), get(rows, first + 12, wide), get(rows, first + 13, wide),
        get(rows, first + 14, wide), get(rows, first + 15, wide), get(rows, first + 16, wide),
        get(rows, first + 17, wide), get(rows, first + 18, wide), get(rows, first + 19, wide),
        get(rows, first + 20, wide)
    )  # fmt: skip


@inner(forceinline=True)
def store(rows, first, wide, b):
    """Leave b in rows from the first on."""
    put(rows, first + 0, wide, b[0])
    put(rows, first + 1, wide, b[1])
    put(rows, first + 2, wide, b[2])
    put(rows, first + 3, wide, b[3])
    put(rows, first + 4, wide, b[4])
    put(rows, first + 5, wide, b[5])
    put(rows, first + 6, wide, b[6])
    put(rows, first + 7, wide, b[7])
    put(rows, first + 8, wide, b[8])
    put(rows, first + 9, wide, b[9])
    put(rows, first + 10, wide, b[10])
    put(rows, first + 11, wide, b[11])
    put(rows, first + 12, wide, b[12])
    put(rows, first + 13, wide, b[13])
    put(rows, first + 14, wide, b[14])
    put(rows, first + 15, wide, b[15])
    put(rows, first + 16, wide, b[16])
    put(rows, first + 17, wide, b[17])
    put(rows, first + 18, wide, b[18])
    put(rows, first + 19, wide, b[19])
    put(rows, first + 20, wide, b[20])


@inner(forceinline=True)
def evaluate(b, x):
    """Return value and rate at x: the sums of b_j x^j/j! and of b_{j+1} x^j/j!."""
    y = p = b[20]
    y = fma(y, 0.05 * x, b[19])
    t = 0.05263157894736842 * x
    p, y = fma(p, t, b[19]), fma(y, t, b[18])
    t = 0.05555555555555555 * x
    p, y = fma(p, t, b[18]), fma(y, t, b[17])
    t = 0.058823529411764705 * x
    p, y = fma(p, t, b[17]), fma(y, t, b[16])
    t = 0.0625 * x
    p, y = fma(p, t, b[16]), fma(y, t, b[15])
    t = 0.06666666666666667 * x
    p, y = fma(p, t, b[15]), fma(y, t, b[14])
    t = 0.07142857142857142 * x
    p, y = fma(p, t, b[14]), fma(y, t, b[13])
    t = 0.07692307692307693 * x
    p, y = fma(p, t, b[13]), fma(y, t, b[12])
    t = 0.08333333333333333 * x
    p, y = fma(p, t, b[12]), fma(y, t, b[11])
    t = 0.09090909090909091 * x
    p, y = fma(p, t, b[11]), fma(y, t, b[10])
    t = 0.1 * x
    p, y = fma(p, t, b[10]), fma(y, t, b[9])
    t = 0.1111111111111111 * x
    p, y = fma(p, t, b[9]), fma(y, t, b[8])
    t = 0.125 * x
    p, y = fma(p, t, b[8]), fma(y, t, b[7])
    t = 0.14285714285714285 * x
    p, y = fma(p, t, b[7]), fma(y, t, b[6])
    t = 0.16666666666666666 * x
    p, y = fma(p, t, b[6]), fma(y, t, b[5])
    t = 0.2 * x
    p, y = fma(p, t, b[5]), fma(y, t, b[4])
    t = 0.25 * x
    p, y = fma(p, t, b[4]), fma(y, t, b[3])
    t = 0.3333333333333333 * x
    p, y = fma(p, t, b[3]), fma(y, t, b[2])
    t = 0.5 * x
    p, y = fma(p, t, b[2]), fma(y, t, b[1])
    t = 1.0 * x
    p, y = fma(p, t, b[1]), fma(y, t, b[0])
    return y, p


@inner(forceinline=True)
def valued(a, x):
    """Return the same from the coefficients, b_j/j!."""
    y = a[20]
    p = 0.0 * y
    p, y = fma(p, x, y), fma(y, x, a[19])
    p, y = fma(p, x, y), fma(y, x, a[18])
    p, y = fma(p, x, y), fma(y, x, a[17])
    p, y = fma(p, x, y), fma(y, x, a[16])
    p, y = fma(p, x, y), fma(y, x, a[15])
    p, y = fma(p, x, y), fma(y, x, a[14])
    p, y = fma(p, x, y), fma(y, x, a[13])
    p, y = fma(p, x, y), fma(y, x, a[12])
    p, y = fma(p, x, y), fma(y, x, a[11])
    p, y = fma(p, x, y), fma(y, x, a[10])
    p, y = fma(p, x, y), fma(y, x, a[9])
    p, y = fma(p, x, y), fma(y, x, a[8])
    p, y = fma(p, x, y), fma(y, x, a[7])
    p, y = fma(p, x, y), fma(y, x, a[6])
    p, y = fma(p, x, y), fma(y, x, a[5])
    p, y = fma(p, x, y), fma(y, x, a[4])
    p, y = fma(p, x, y), fma(y, x, a[3])
    p, y = fma(p, x, y), fma(y, x, a[2])
    p, y = fma(p, x, y), fma(y, x, a[1])
    p, y = fma(p, x, y), fma(y, x, a[0])
    return y, p


@inner(forceinline=True)
def integral(b, x):
    """Return the integral from 0 to x: the sum of b_j x^{j+1}/(j+1)!."""
    y = 0.047619047619047616 * x * b[20]
    y = 0.05 * x * (b[19] + y)
    y = 0.05263157894736842 * x * (b[18] + y)
    y = 0.05555555555555555 * x * (b[17] + y)
    y = 0.058823529411764705 * x * (b[16] + y)
    y = 0.0625 * x * (b[15] + y)
    y = 0.06666666666666667 * x * (b[14] + y)
    y = 0.07142857142857142 * x * (b[13] + y)
    y = 0.07692307692307693 * x * (b[12] + y)
    y = 0.08333333333333333 * x * (b[11] + y)
    y = 0.09090909090909091 * x * (b[10] + y)
    y = 0.1 * x * (b[9] + y)
    y = 0.1111111111111111 * x * (b[8] + y)
    y = 0.125 * x * (b[7] + y)
    y = 0.14285714285714285 * x * (b[6] + y)
    y = 0.16666666666666666 * x * (b[5] + y)
    y = 0.2 * x * (b[4] + y)
    y = 0.25 * x * (b[3] + y)
    y = 0.3333333333333333 * x * (b[2] + y)
    y = 0.5 * x * (b[1] + y)
    y = 1.0 * x * (b[0] + y)
    return y


@inner(forceinline=True)
def slipped(b, p, q):
    """Return p b + q b'."""
    return (
        fma(p, b[0], q * b[1]), fma(p, b[1], q * b[2]), fma(p, b[2], q * b[3]), fma(p, b[3], q * b[4]),
        fma(p, b[4], q * b[5]), fma(p, b[5], q * b[6]), fma(p, b[6], q * b[7]), fma(p, b[7], q * b[8]),
        fma(p, b[8], q * b[9]), fma(p, b[9], q * b[10]), fma(p, b[10], q * b[11]), fma(p, b[11], q * b[12]),
        fma(p, b[12], q * b[13]), fma(p, b[13], q * b[14]), fma(p, b[14], q * b[15]), fma(p, b[15], q * b[16]),
        fma(p, b[16], q * b[17]), fma(p, b[17], q * b[18]), fma(p, b[18], q * b[19]), fma(p, b[19], q * b[20]),
        p * b[20]
    )  # fmt: skip


@inner(forceinline=True)
def rates(a):
    """Return the coefficients of the rate."""
    return (
        1.0 * a[1], 2.0 * a[2], 3.0 * a[3], 4.0 * a[4], 5.0 * a[5], 6.0 * a[6], 7.0 * a[7], 8.0 * a[8], 9.0 * a[9],
        10.0 * a[10], 11.0 * a[11], 12.0 * a[12], 13.0 * a[13], 14.0 * a[14], 15.0 * a[15], 16.0 * a[16], 17.0 * a[17],
        18.0 * a[18], 19.0 * a[19], 20.0 * a[20], 0.0 * a[0]
    )  # fmt: skip


@inner(forceinline=True)
def tail(a):
    """Return the sum of the negative coefficients from the eighth on: a lower bound of their part over 0 <= x <= 1."""
    t = 0.0 * a[8]
    t = t + select(a[8] < 0.0, a[8], 0.0)
    t = t + select(a[9] < 0.0, a[9], 0.0)
    t = t + select(a[10] < 0.0, a[10], 0.0)
    t = t + select(a[11] < 0.0, a[11], 0.0)
    t = t + select(a[12] < 0.0, a[12], 0.0)
    t = t + select(a[13] < 0.0, a[13], 0.0)
    t = t + select(a[14] < 0.0, a[14], 0.0)
    t = t + select(a[15] < 0.0, a[15], 0.0)
    t = t + select(a[16] < 0.0, a[16], 0.0)
    t = t + select(a[17] < 0.0, a[17], 0.0)
    t = t + select(a[18] < 0.0, a[18], 0.0)
    t = t + select(a[19] < 0.0, a[19], 0.0)
    t = t + select(a[20] < 0.0, a[20], 0.0)
    return t


@inner(forceinline=True)
def bend(a):
    """Return a bound of |u''| over 0 <= x <= 1."""
    t = 2.0 * abs(a[2])
    t = fma(abs(a[3]), 6.0, t)
    t = fma(abs(a[4]), 12.0, t)
    t = fma(abs(a[5]), 20.0, t)
    t = fma(abs(a[6]), 30.0, t)
    t = fma(abs(a[7]), 42.0, t)
    t = fma(abs(a[8]), 56.0, t)
    t = fma(abs(a[9]), 72.0, t)
    t = fma(abs(a[10]), 90.0, t)
    t = fma(abs(a[11]), 110.0, t)
    t = fma(abs(a[12]), 132.0, t)
    t = fma(abs(a[13]), 156.0, t)
    t = fma(abs(a[14]), 182.0, t)
    t = fma(abs(a[15]), 210.0, t)
    t = fma(abs(a[16]), 240.0, t)
    t = fma(abs(a[17]), 272.0, t)
    t = fma(abs(a[18]), 306.0, t)
    t = fma(abs(a[19]), 342.0, t)
    t = fma(abs(a[20]), 380.0, t)
    return t
