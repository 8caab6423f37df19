"""Elementary functions and Euler angles with bit-identical results on every processor, built from + − × ÷ and √ alone.

IEEE 754 fixes the rounding of these five operations. libm selects variants by processor features (FMA, AVX2) that
differ in the last place. Everything that a flight computes uses the functions here, which have the same polynomials in
the same order as ``firmware/core/fs_math.c`` and ``fs_geometry.h`` in double precision.

They are plain Python, which ``compiled`` registers with Numba; programs without compiled code do not import Numba.
Errors are in units in the last place (ulp), measured over a million arguments (tests/unit/test_portable_math.py).
"""

from __future__ import annotations

import math

LARGEST_ANGLE_RAD = 1e4
"""Largest angle of either sign for ``sin_cos``: 1591 turns."""
LARGEST_SQUARE = 0.1715
"""Square of the tangent of 22.5°, the largest argument of ``arc_tangent_series``."""
_HALF_PI, _HALF_PI_REST = 1.5707963267948966, 6.123233995736766e-17
_LN2_1, _LN2_2 = 0.693147180369123816490, 1.90821492927058770002e-10  # the first part has 33 bits
_LEAST_EXPONENT, _LARGEST_EXPONENT = -745.2, 709.78


def sin_cos(angle_rad: float) -> tuple[float, float]:
    """Return sine and cosine, within 1.4 ulp within one turn; both NaN beyond ``LARGEST_ANGLE_RAD``."""
    if not abs(angle_rad) <= LARGEST_ANGLE_RAD:
        return math.nan, math.nan
    return bounded_sin_cos(angle_rad)


def bounded_sin_cos(angle_rad: float) -> tuple[float, float]:
    """Return ``sin_cos`` of an angle up to ``LARGEST_ANGLE_RAD``: without the check, loops are vectorised."""
    turns = angle_rad * 0.6366197723675814  # 2/π
    turns = turns - 0.5 if turns < 0.0 else turns + 0.5
    quadrant = int(turns)
    turns = float(quadrant)
    # π/2 in three parts: the products with the number of quarter turns and the differences are exact
    angle = (
        (angle_rad - turns * 1.570796326734125614166259765625) - turns * 6.077100506303965976595549e-11
    ) - turns * 2.0222662487959506e-21
    square = angle * angle
    # Taylor's series up to π/4
    series = 1.0 / 355687428096000.0  # 1/17!
    series = series * square - 1.0 / 1307674368000.0
    series = series * square + 1.0 / 6227020800.0
    series = series * square - 1.0 / 39916800.0
    series = series * square + 1.0 / 362880.0
    series = series * square - 1.0 / 5040.0
    series = series * square + 1.0 / 120.0
    series = series * square - 1.0 / 6.0
    sine = angle + angle * (square * series)
    series = -1.0 / 6402373705728000.0  # 1/18!
    series = series * square + 1.0 / 20922789888000.0
    series = series * square - 1.0 / 87178291200.0
    series = series * square + 1.0 / 479001600.0
    series = series * square - 1.0 / 3628800.0
    series = series * square + 1.0 / 40320.0
    series = series * square - 1.0 / 720.0
    series = series * square + 1.0 / 24.0
    cosine = 1.0 - (0.5 * square - square * (square * series))
    if quadrant & 1:
        sine, cosine = cosine, sine
    return -sine if quadrant & 2 else sine, -cosine if quadrant + 1 & 2 else cosine


def tan(angle_rad: float) -> float:
    """Return the tangent, within 3 ulp within one turn; see ``sin_cos``."""
    sine, cosine = sin_cos(angle_rad)
    return sine / cosine


def arc_tangent_series(square: float) -> float:
    """Return atan(r)/r − 1 for ``square`` = r² up to ``LARGEST_SQUARE``."""
    # Chebyshev nodes; error at most 5e-18
    series = -0.01917454357202133
    series = series * square + 0.039229744536612224
    series = series * square - 0.05085383488842831
    series = series * square + 0.05858136251906146
    series = series * square - 0.06664509989818045
    series = series * square + 0.07692183087342026
    series = series * square - 0.0909090457366906
    series = series * square + 0.11111111015146714
    series = series * square - 0.1428571428466518
    series = series * square + 0.19999999999995513
    series = series * square - 0.3333333333333333
    return series * square


def atan2(y: float, x: float) -> float:
    """Return the angle of the point (x, y) from the x axis, in [−π, π], within 3 ulp; 0 for the origin."""
    if math.isnan(x + y):
        return math.nan
    width, height = abs(x), abs(y)
    ratio = 0.0
    if width != height:
        ratio = height / width if height < width else width / height
    elif width > 0.0:
        ratio = 1.0
    square = ratio * ratio
    if square < LARGEST_SQUARE:
        angle = ratio + ratio * arc_tangent_series(square)
    else:  # tan(a/2) = tan a / (1 + √(1 + tan² a))
        half = ratio / (1.0 + math.sqrt(1.0 + square))
        angle = 2.0 * (half + half * arc_tangent_series(half * half))
    if height > width:
        angle = _HALF_PI - (angle - _HALF_PI_REST)
    if math.copysign(1.0, x) < 0.0:
        angle = 2.0 * _HALF_PI - (angle - 2.0 * _HALF_PI_REST)
    return math.copysign(angle, y)


def asin(sine: float) -> float:
    """Return the angle in [−π/2, π/2] of a sine in [−1, 1], within 4 ulp."""
    return atan2(sine, math.sqrt((1.0 - sine) * (1.0 + sine)))


def acos(cosine: float) -> float:
    """Return the angle in [0, π] of a cosine in [−1, 1], within 4 ulp."""
    return atan2(math.sqrt((1.0 - cosine) * (1.0 + cosine)), cosine)


def exp(exponent: float) -> float:
    """Return e to the power of ``exponent``, within 1 ulp; NaN for NaN."""
    if math.isnan(exponent):
        return math.nan
    if exponent > _LARGEST_EXPONENT:
        return math.inf
    if exponent < _LEAST_EXPONENT:
        return 0.0
    power = math.floor(exponent * 1.4426950408889634 + 0.5)  # 1/ln 2
    rest = (exponent - power * _LN2_1) - power * _LN2_2
    series = 1.0 / 6227020800.0  # 1/13!
    series = series * rest + 1.0 / 479001600.0
    series = series * rest + 1.0 / 39916800.0
    series = series * rest + 1.0 / 3628800.0
    series = series * rest + 1.0 / 362880.0
    series = series * rest + 1.0 / 40320.0
    series = series * rest + 1.0 / 5040.0
    series = series * rest + 1.0 / 720.0
    series = series * rest + 1.0 / 120.0
    series = series * rest + 1.0 / 24.0
    series = series * rest + 1.0 / 6.0
    series = series * rest + 0.5
    return math.ldexp(1.0 + (rest + rest * rest * series), int(power))


def log(number: float) -> float:
    """Return the natural logarithm of a positive, finite number, within 2 ulp."""
    mantissa, power = math.frexp(number)
    if mantissa < 0.7071067811865476:
        mantissa, power = 2.0 * mantissa, power - 1
    # ln m = 2 artanh t, t = (m − 1)/(m + 1), up to 0.172
    ratio = (mantissa - 1.0) / (mantissa + 1.0)
    square = ratio * ratio
    series = 1.0 / 21.0
    series = series * square + 1.0 / 19.0
    series = series * square + 1.0 / 17.0
    series = series * square + 1.0 / 15.0
    series = series * square + 1.0 / 13.0
    series = series * square + 1.0 / 11.0
    series = series * square + 1.0 / 9.0
    series = series * square + 1.0 / 7.0
    series = series * square + 1.0 / 5.0
    series = series * square + 1.0 / 3.0
    return power * _LN2_1 + (2.0 * ratio + (2.0 * ratio * (square * series) + power * _LN2_2))


def distance(x: float, y: float, z: float = 0.0) -> float:
    """Return the length of a vector, below 1e150 so that squares are finite."""
    return math.sqrt(x * x + y * y + z * z)


def whole_within(value: float, low: float, high: float) -> int:
    """Round to a whole number in [low, high], half to even; 0 for a value that is not finite."""
    return round(min(max(value, low), high)) if math.isfinite(value) else 0


def roll_angle(w: float, x: float, y: float, z: float) -> float:
    """Return the roll [rad] (3-2-1) of a unit quaternion, body FRD to world NED, in (−π, π]."""
    return atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))


def pitch_angle(w: float, x: float, y: float, z: float) -> float:
    """Return the pitch [rad] (3-2-1) of a unit quaternion, body FRD to world NED, in [−π/2, π/2]."""
    return asin(min(1.0, max(-1.0, 2.0 * (w * y - z * x))))


def yaw_angle(w: float, x: float, y: float, z: float) -> float:
    """Return the yaw [rad] (3-2-1) of a unit quaternion, body FRD to world NED, in (−π, π]."""
    return atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def euler_angles(w: float, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Return roll, pitch and yaw [rad] of a unit quaternion."""
    return roll_angle(w, x, y, z), pitch_angle(w, x, y, z), yaw_angle(w, x, y, z)


FUNCTIONS = (
    sin_cos, bounded_sin_cos, tan, arc_tangent_series, atan2, asin, acos, exp, log, distance, whole_within,
    roll_angle, pitch_angle, yaw_angle, euler_angles,
)  # fmt: skip
"""Functions available to compiled code."""
