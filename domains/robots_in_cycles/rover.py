"""A round robot with two wheels in MuJoCo, with the extra `physics`: wheels, rays and contacts.

No other module imports mujoco.
"""

from __future__ import annotations

import math
import os
from typing import Any

import numpy as np
from numpy.typing import NDArray

from knowledge_base.errors import InputError

RADIUS = 0.07
"""Radius of the robot in metres."""
_STEP = 0.004
_PICTURE = 240, 320
"""Rows and columns of a picture."""
_BODY = """
<body name="rover" pos="{x} {y} 0.03" euler="0 0 {heading}">
  <freejoint/>
  <geom name="hull" type="cylinder" size="{radius} 0.015" pos="0 0 0.015" mass="0.6" rgba="0.85 0.35 0.15 1"/>
  <geom type="box" size="0.02 0.006 0.002" pos="0.045 0 0.031" mass="0" contype="0" conaffinity="0" rgba="1 1 1 1"/>
  <geom type="sphere" size="0.01" pos="0.055 0 -0.02" condim="1" priority="1" mass="0.02"/>
  <geom type="sphere" size="0.01" pos="-0.055 0 -0.02" condim="1" priority="1" mass="0.02"/>
  <body pos="0 0.055 0">
    <joint name="left" axis="0 1 0"/>
    <geom type="cylinder" size="0.03 0.008" euler="90 0 0" mass="0.05" group="4"/>
  </body>
  <body pos="0 -0.055 0">
    <joint name="right" axis="0 1 0"/>
    <geom type="cylinder" size="0.03 0.008" euler="90 0 0" mass="0.05" group="4"/>
  </body>
</body>
"""
_WORLD = """
<mujoco>
  <option timestep="{step}" integrator="implicitfast"/>
  <visual><headlight ambient="0.5 0.5 0.5" diffuse="0.3 0.3 0.3"/></visual>
  <worldbody>
    <light pos="0 0 4" dir="0 0 -1" diffuse="0.4 0.4 0.4" castshadow="false"/>
    <geom name="floor" type="plane" size="5 5 0.1" rgba="0.93 0.93 0.9 1"/>{scenery}{body}
  </worldbody>
  <actuator><velocity joint="left" kv="0.05"/><velocity joint="right" kv="0.05"/></actuator>
</mujoco>
"""


class Rover:
    """The robot in a scenery.

    Args:
        scenery: the other geoms of the world in MJCF.
        x, y: position at the start in metres.
        heading: direction at the start in degrees.

    Attributes:
        contacts: the number of times that the hull has begun to touch something.
    """

    def __init__(self, scenery: str, x: float, y: float, heading: float) -> None:
        try:
            import mujoco  # noqa: PLC0415  the extra may be missing
        except ModuleNotFoundError:
            remedy = "pip install 'dynamic-state-charts[physics]'"
            raise InputError(f"this robot needs MuJoCo, which is not installed: {remedy}") from None
        except Exception as error:  # it loads the library of graphics that MUJOCO_GL names
            raise _undrawable(error) from error
        self._engine = mujoco
        body = _BODY.format(x=x, y=y, heading=heading, radius=RADIUS)
        self._model = mujoco.MjModel.from_xml_string(_WORLD.format(step=_STEP, scenery=scenery, body=body))
        self._data = mujoco.MjData(self._model)
        self._rover, self._hull = self._model.body("rover").id, self._model.geom("hull").id
        self._floor = self._model.geom("floor").id
        self._touches = False
        self._camera: _Camera | None = None
        self.contacts = 0
        mujoco.mj_forward(self._model, self._data)

    def picture(self) -> NDArray[np.uint8]:
        """Return what a camera above and behind the robot sees: rows, columns, and red, green and blue.

        Raises:
            InputError: MuJoCo cannot draw on this machine.
        """
        if self._camera is None:
            self._camera = _Camera(self._engine, self._model, self._rover)
        return self._camera.take(self._data)

    @property
    def position(self) -> tuple[float, float]:
        """The place of the centre in metres."""
        x, y, _ = self._data.xpos[self._rover]
        return float(x), float(y)

    @property
    def seconds(self) -> float:
        """The time of the simulation."""
        return float(self._data.time)

    def point(self, ahead: float, aside: float = 0.0) -> tuple[float, float]:
        """Return the place of a point of the robot, in metres ahead of the centre and to its left."""
        x, y, _ = self._data.xpos[self._rover] + self._data.xmat[self._rover].reshape(3, 3) @ (ahead, aside, 0)
        return float(x), float(y)

    def drive(self, left: float, right: float, seconds: float) -> None:
        """Turn the wheels at speeds in rad/s for a time."""
        self._data.ctrl[:] = left, right
        for _ in range(round(seconds / _STEP)):
            self._engine.mj_step(self._model, self._data)
            touches = self._hits()
            self.contacts += touches and not self._touches
            self._touches = touches

    def _hits(self) -> bool:
        return any(self._hull in pair and self._floor not in pair for pair in self._data.contact.geom.tolist())

    def below(self, ahead: float, aside: float) -> str:
        """Return the name of the geom on the floor below a point of the robot."""
        hit = np.zeros(1, dtype=np.int32)
        x, y = self.point(ahead, aside)
        self._cast((x, y, 0.01), (0, 0, -1), hit)
        return str(self._model.geom(int(hit[0])).name)

    def distance(self, angle: float, most: float) -> float:
        """Return the distance from the hull to the nearest thing in a direction, in metres, at most `most`.

        Args:
            angle: the direction relative to the heading, in degrees to the left.
            most: the range of the sensor.
        """
        turned = math.radians(angle)
        way = self._data.xmat[self._rover].reshape(3, 3) @ (math.cos(turned), math.sin(turned), 0)
        way[2] = 0
        found = self._cast(self._data.xpos[self._rover] + (0, 0, 0.015), way, np.zeros(1, dtype=np.int32))
        return most if found < 0 else min(max(found - RADIUS, 0.0), most)

    def _cast(self, start: object, way: object, hit: NDArray[np.int32]) -> float:
        seen = np.array([1, 1, 1, 1, 0, 0], dtype=np.uint8)
        start, way = np.array(start, dtype=float), np.array(way, dtype=float)
        return float(self._engine.mj_ray(self._model, self._data, start, way, seen, 1, self._rover, hit))


class _Camera:
    """A camera that follows a body."""

    def __init__(self, engine: Any, model: Any, body: int) -> None:
        try:
            self._renderer = engine.Renderer(model, *_PICTURE)
        except Exception as error:  # each library of graphics has own classes
            raise _undrawable(error) from error
        self._camera, self._visible = engine.MjvCamera(), engine.MjvOption()
        self._camera.type, self._camera.trackbodyid = engine.mjtCamera.mjCAMERA_TRACKING, body
        self._camera.distance, self._camera.elevation, self._camera.azimuth = 1.3, -50, 90
        self._visible.geomgroup[4] = 1  # the wheels, which rays pass

    def take(self, data: Any) -> NDArray[np.uint8]:
        """Return the picture of a moment."""
        self._renderer.update_scene(data, self._camera, self._visible)
        picture: NDArray[np.uint8] = self._renderer.render()
        return picture


def _undrawable(error: Exception) -> InputError:
    library = os.environ.get("MUJOCO_GL", "not set")
    remedy = "set it to `egl` or `osmesa`, or with a display to `glfw`, and install that library"
    return InputError(f"MuJoCo cannot draw on this machine: {error}; MUJOCO_GL is {library}: {remedy}")
