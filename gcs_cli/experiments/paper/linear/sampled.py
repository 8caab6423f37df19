"""The loops as the computer runs them: sampled, held, delayed, and at two rates.

Each loop is written once, as one inner tick on arrays whose columns are states. The same function simulates a step
response and, applied to the unit matrix, gives the matrix of the tick. The result is exact: the vehicle is integrated
in closed form between ticks, and the matrix of an outer period is a power of the matrix of an inner tick.

The order of events is that of the flight stack: the actuators of time t answer the state of time t and hold until the
next tick. With ``delay_steps`` they act that many ticks later.
"""

from __future__ import annotations

from functools import cache, cached_property
from typing import NamedTuple

import numpy as np
from scipy.linalg import expm

from flightstack.core.contract import FloatArray
from flightstack.params.vehicle import GRAVITY_M_S2
from gcs_cli.experiments.paper.linear.gains import AttitudeGains, Gains, PositionGains, ReferenceFilter


class Actuators(NamedTuple):
    """Motors and delay between a demand and its force or torque.

    ``lag_s`` is the motors' first-order lag. ``lead_s`` belongs to yaw on a plant with the rotors' spin-up torque:
    J_r/(2 d Ω_hover): torque/demand = (1 + lead s)/(1 + lag s). It has no effect without a lag.
    """

    delay_steps: int = 0
    lag_s: float = 0.0
    lead_s: float = 0.0


class Rates(NamedTuple):
    """Rates of the loops [Hz]; an outer period has a whole number of inner ticks."""

    inner_hz: float
    outer_hz: float

    @property
    def divisor(self) -> int:
        """Inner ticks in an outer period."""
        return round(self.inner_hz / self.outer_hz)


@cache
def _held_chain(
    dt_s: float, lag_s: float, lead_s: float, gravity_m_s2: float
) -> tuple[FloatArray, FloatArray]:
    """Return the transition of [position, velocity, angle, rate, motor] over ``dt_s``: (5, 5), and (5,) of the demand.

    position' = velocity, velocity' = g·angle, angle' = rate, rate' = torque, motor' = (demand − motor)/lag.
    """
    slope = np.zeros((6, 6))
    slope[0, 1], slope[1, 2], slope[2, 3] = 1.0, gravity_m_s2, 1.0
    if lag_s > 0.0:
        share = lead_s / lag_s  # of the demand, acting at once
        slope[3, 4], slope[3, 5] = 1.0 - share, share
        slope[4, 4], slope[4, 5] = -1.0 / lag_s, 1.0 / lag_s
    else:
        slope[3, 5] = 1.0
    over: FloatArray = np.asarray(expm(slope * dt_s))
    if lag_s == 0.0:
        over[4, 4] = 0.0  # no motor: an unused state would be a pole at 1
    return over[:5, :5], over[:5, 5]


class AttitudeTick:
    """One inner tick of one attitude axis. State: [angle, rate, motor, integral, delayed demands …]."""

    def __init__(self, gains: AttitudeGains, inner_hz: float, actuators: Actuators) -> None:
        self.gains, self.dt_s, self.delay = gains, 1.0 / inner_hz, actuators.delay_steps
        self.size = 4 + self.delay
        matrix, column = _held_chain(self.dt_s, actuators.lag_s, actuators.lead_s, 1.0)
        self._matrix, self._column = matrix[2:, 2:], column[2:]

    def law(self, state: FloatArray, angle_d: float | FloatArray, rate_d: float | FloatArray,
            acceleration_d: float | FloatArray) -> tuple[FloatArray, FloatArray]:  # fmt: skip
        """Return the state with its integral advanced, and the demand [rad/s²]."""
        g, error = self.gains, angle_d - state[0]
        state = state.copy()
        state[3] = state[3] + error * self.dt_s if g.ki else 0.0  # unused without a gain
        demand = (
            g.kp * error
            + g.ki * state[3]
            + g.kd * (g.rate_feedforward * rate_d - state[1])
            + g.acceleration_feedforward * acceleration_d
        )
        return state, demand

    def move(self, state: FloatArray, demand: FloatArray) -> FloatArray:
        """Advance the vehicle and the delay by one tick."""
        acting, line = _through_delay(state[4:], demand)
        state = state.copy()
        state[:3] = self._matrix @ state[:3] + np.multiply.outer(self._column, acting)
        state[4:] = line
        return state

    def closed(self) -> FloatArray:
        """Return the matrix of one tick with the loop closed and the reference at zero."""
        return self.move(*self.law(np.eye(self.size), 0.0, 0.0, 0.0))

    def open(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return (A, B, C) of the loop cut at the demand: its negative output is the feedback."""
        unit, nothing = np.eye(self.size), np.zeros(self.size)
        advanced, demand = self.law(unit, 0.0, 0.0, 0.0)
        return self.move(advanced, nothing), self.move(np.zeros((self.size, 1)), np.ones(1))[:, 0], -demand

    def step_response(self, ticks: int, angle_d: float = 1.0, rate: float = 0.0) -> FloatArray:
        """Return the angle at the beginning of each tick after a step of the reference; ``rate`` at the start."""
        state = np.zeros(self.size)
        state[1] = rate
        angles = np.empty(ticks)
        for tick in range(ticks):
            angles[tick] = state[0]
            state = self.move(*self.law(state, angle_d, 0.0, 0.0))
        return angles


def _through_delay(line: FloatArray, demand: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Push ``demand`` into the delay line; return its output and the new line."""
    if len(line) == 0:
        return demand, line
    return line[-1], np.concatenate([demand[np.newaxis], line[:-1]])


class Period:
    """One outer period of a position axis, in two parts: ``begin`` computes the outer loop, then inner ticks follow.

    An inner tick is linear in the state of ``begin``, which appends the value held for the period.
    """

    size: int
    position: PositionGains
    rates: Rates

    def begin(self, state: FloatArray, demand: FloatArray, setpoint: float = 0.0) -> FloatArray:
        """Return ``state`` (size, …) after the outer loop, with one more row: the value held for the period."""
        raise NotImplementedError

    def tick(self, state: FloatArray) -> FloatArray:
        """Advance a state of ``begin`` by one inner tick."""
        raise NotImplementedError

    @cached_property
    def _tick_matrix(self) -> FloatArray:
        return self.tick(np.eye(self.size + 1))

    def run(self, state: FloatArray, demand: FloatArray) -> FloatArray:
        """Advance by one outer period with the setpoint at zero."""
        over = np.linalg.matrix_power(self._tick_matrix, self.rates.divisor)
        moved: FloatArray = (over @ self.begin(state, demand))[: self.size]
        return moved

    def demand(self, state: FloatArray, setpoint: float) -> FloatArray:
        """Return the acceleration demand of the outer loop [m/s²]."""
        g = self.position
        wanted: FloatArray = g.kp * (setpoint - state[0]) - g.kd * state[1] + state[2]
        return wanted

    def _integrated(self, state: FloatArray, setpoint: float) -> FloatArray | float:
        """Return the integral [m/s²] after this period; unused without a gain."""
        if self.position.ki == 0.0:
            return 0.0
        advanced: FloatArray = state[2] + self.position.ki / self.rates.outer_hz * (setpoint - state[0])
        return advanced

    def closed(self) -> FloatArray:
        """Return the matrix of one outer period with all loops closed and the setpoint at zero."""
        unit = np.eye(self.size)
        return self.run(unit, self.demand(unit, 0.0))

    def open(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return (A, B, C) of the outer loop cut at its demand, sampled once in each outer period."""
        unit = np.eye(self.size)
        column = self.run(np.zeros((self.size, 1)), np.ones(1))[:, 0]
        return self.run(unit, np.zeros(self.size)), column, -self.demand(unit, 0.0)

    def step_response(self, periods: int, setpoint: float = 1.0) -> FloatArray:
        """Return the position at the beginning of each inner tick after a step of the setpoint."""
        state, positions = np.zeros(self.size), []
        for _ in range(periods):
            held = self.begin(state, self.demand(state, setpoint), setpoint)
            for _ in range(self.rates.divisor):
                positions.append(float(held[0]))
                held = self._tick_matrix @ held
            state = held[: self.size]
        return np.array(positions)


class HorizontalPeriod(Period):
    """x or y: outer loop, target moved in a straight line, reference filter, attitude loop, vehicle.

    State: [position, velocity, integral, target, aim, reference angle, reference rate, angle, rate, motor, attitude
    integral, delayed demands …]; the target moves to the aim during the period, and its change in a tick is the held
    row. Angles are tilts in the direction of the axis.
    """

    def __init__(self, position: PositionGains, attitude: AttitudeGains, reference: ReferenceFilter,
                 rates: Rates, actuators: Actuators, gravity_m_s2: float) -> None:  # fmt: skip
        self.position, self.rates, self._reference = position, rates, reference
        self._attitude = AttitudeTick(attitude, rates.inner_hz, actuators)
        self._gravity = gravity_m_s2
        self._matrix, self._column = _held_chain(
            1.0 / rates.inner_hz, actuators.lag_s, actuators.lead_s, gravity_m_s2
        )
        self.size = 11 + actuators.delay_steps

    def begin(self, state: FloatArray, demand: FloatArray, setpoint: float = 0.0) -> FloatArray:
        """Set integral and aim; see ``Period``."""
        state = state.copy()
        state[2] = self._integrated(state, setpoint)
        state[3], state[4] = state[4].copy(), demand / self._gravity
        return np.concatenate([state, (state[4:5] - state[3:4]) / self.rates.divisor])

    def tick(self, state: FloatArray) -> FloatArray:
        """Advance by one inner tick; see ``Period``."""
        state = state.copy()
        state[3] = state[3] + state[-1]
        acceleration = self._filter(state)
        inner, wanted = self._attitude.law(state[7:-1], state[5], state[6], acceleration)
        acting, line = _through_delay(inner[4:], wanted)
        chain = np.stack([state[0], state[1], inner[0], inner[1], inner[2]])
        chain = self._matrix @ chain + np.multiply.outer(self._column, acting)
        state[0:2], state[7:10], state[10], state[11:-1] = chain[:2], chain[2:], inner[3], line
        return state

    def _filter(self, state: FloatArray) -> FloatArray:
        """Advance the reference filter in place, rate first as the loops do; return its acceleration."""
        w, dt_s, target = self._reference.bandwidth_rad_s, 1.0 / self.rates.inner_hz, state[3]
        if w <= 0.0:
            state[5], state[6] = target, 0.0
            return np.zeros_like(target)
        acceleration: FloatArray = w * w * (target - state[5]) - 2.0 * self._reference.damping * w * state[6]
        state[6] = state[6] + acceleration * dt_s
        state[5] = state[5] + state[6] * dt_s
        return acceleration


class VerticalPeriod(Period):
    """z: the outer loop's thrust, held over an outer period.

    State: [position, velocity, integral, motor, delayed demands …]; the demand is the held row.
    """

    def __init__(self, position: PositionGains, rates: Rates, actuators: Actuators) -> None:
        self.position, self.rates = position, rates
        matrix, column = _held_chain(1.0 / rates.inner_hz, actuators.lag_s, 0.0, 1.0)
        self._matrix, self._column = matrix[2:, 2:], column[2:]
        self.size = 4 + actuators.delay_steps

    def begin(self, state: FloatArray, demand: FloatArray, setpoint: float = 0.0) -> FloatArray:
        """Set the integral and the demand; see ``Period``."""
        state = state.copy()
        state[2] = self._integrated(state, setpoint)
        return np.concatenate([state, np.asarray(demand)[np.newaxis]])

    def tick(self, state: FloatArray) -> FloatArray:
        """Advance by one inner tick; see ``Period``."""
        acting, line = _through_delay(state[4:-1], state[-1])
        moved = self._matrix @ state[[0, 1, 3]] + np.multiply.outer(self._column, acting)
        state = state.copy()
        state[[0, 1, 3]], state[4:-1] = moved, line
        return state


TILT_OF = {"x": "pitch", "y": "roll"}
"""The attitude axis inside each horizontal loop."""


def period_of(gains: Gains, axis: str, rates: Rates, actuators: Actuators) -> Period:
    """Return the sampled loop of a position axis."""
    if axis == "z":
        return VerticalPeriod(gains.position[axis], rates, actuators)
    law = gains.attitude[TILT_OF[axis]]
    return HorizontalPeriod(gains.position[axis], law, gains.reference, rates, actuators, GRAVITY_M_S2)
