"""gym-pybullet-drones flies a square: its Crazyflie in PyBullet, without a window, with its PID controller."""

from __future__ import annotations

import numpy as np
from answering import RATE_HZ, answer, place_m
from gym_pybullet_drones.control.DSLPIDControl import DSLPIDControl
from gym_pybullet_drones.envs.CtrlAviary import CtrlAviary
from gym_pybullet_drones.utils.enums import DroneModel


def _fly(seconds: float) -> tuple[float, float]:
    env = CtrlAviary(
        drone_model=DroneModel.CF2X,
        initial_xyzs=np.array([place_m(0.0)]),
        pyb_freq=RATE_HZ,
        ctrl_freq=RATE_HZ,
        gui=False,
        user_debug_gui=False,
    )
    controller, action = DSLPIDControl(DroneModel.CF2X), np.zeros((1, 4))
    steps = round(seconds * RATE_HZ)
    for number in range(steps):
        seen, *_ = env.step(action)
        target_m = np.array(place_m(number / RATE_HZ))
        action[0], _, _ = controller.computeControlFromState(env.CTRL_TIMESTEP, seen[0], target_m)
    env.close()
    return steps / RATE_HZ, np.linalg.norm(seen[0][:3] - target_m)


if __name__ == "__main__":
    answer(_fly)
