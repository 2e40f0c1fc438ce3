"""Rigid bodies in pybullet: mass, gravity, drag, limited thrust, collisions between bodies and with the ground.

Each multirotor is a rigid body under a thrust vector. The attitude loop, ten times faster than the velocity loop, is
taken as ideal within the tilt limit. Not modeled: rotor dynamics, wind, ground effect, downwash.

Pybullet keeps an external force over the substeps of one step, so the thrust is set at 60 Hz while contacts and motion
are solved at `physics_hz`.
"""

import math
from typing import Final

import numpy as np

from sim.world.engines.contract import Engine, Flags, Rows
from sim.world.engines.quiet_pybullet import pybullet
from sim.world.environment.obstacles import Hills, Obstacles

MASS_KG: Final = 1.5
ARM_M: Final = 0.25
_HEIGHT_M: Final = 0.1
_GRAVITY: Final = 9.81
_MAX_THRUST_N: Final = 2.0 * MASS_KG * _GRAVITY
_MAX_TILT: Final = math.radians(35)
_DRAG_N_S_M: Final = 0.25
"""Linear drag; at 15 m/s it is a quarter of the weight, as for a small quadrotor."""
_GAIN: Final = 2.5
"""The gain of the velocity loop [1/s]."""
_CONTROL_HZ: Final = 60
_OBSTACLE_GROUP: Final = 64
"""The collision group of hills and buildings: they collide with bodies, but not with the ground or each other. Rays
only test this group."""
_BODY_GROUP: Final = 1


class Physics(Engine):
    """pybullet in DIRECT mode: no window, no display."""

    name = "pybullet"

    def __init__(self, *, physics_hz: int, obstacles: Obstacles | None = None) -> None:
        self._client = pybullet.connect(pybullet.DIRECT)
        self._substeps = max(1, round(physics_hz / _CONTROL_HZ))
        self._obstacles = obstacles
        self._left_s = 0.0
        self._bodies: list[int] = []
        self._node_of: dict[int, int] = {}
        self._at = np.zeros((0, 3))
        self._velocity = np.zeros((0, 3))
        self._touching: frozenset[tuple[int, int]] = frozenset()
        self._new: list[tuple[int, int]] = []
        self._wrecks: list[int] = []

    def reset(self, positions: Rows, velocities: Rows | None = None) -> None:
        client = self._client
        pybullet.resetSimulation(physicsClientId=client)
        pybullet.setGravity(0, 0, -_GRAVITY, physicsClientId=client)
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=1 / _CONTROL_HZ, numSubSteps=self._substeps, deterministicOverlappingPairs=1,
            physicsClientId=client,
        )  # fmt: skip
        plane = pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=client)
        ground = pybullet.createMultiBody(0, plane, physicsClientId=client)
        hull = pybullet.createCollisionShape(
            pybullet.GEOM_CYLINDER, radius=ARM_M, height=_HEIGHT_M, physicsClientId=client
        )
        self._bodies = [
            pybullet.createMultiBody(MASS_KG, hull, basePosition=at.tolist(), physicsClientId=client)
            for at in positions
        ]
        for body in self._bodies:
            pybullet.changeDynamics(
                body, -1, linearDamping=0, angularDamping=0.9,
                activationState=pybullet.ACTIVATION_STATE_DISABLE_SLEEPING, physicsClientId=client,
            )  # fmt: skip
        solid = [ground, *self._build()]
        self._node_of = dict.fromkeys(solid, 0) | {body: i + 1 for i, body in enumerate(self._bodies)}
        self._at = positions.copy()
        self._velocity = np.zeros_like(positions) if velocities is None else velocities.copy()
        for body, velocity in zip(self._bodies, self._velocity.tolist(), strict=True):
            pybullet.resetBaseVelocity(body, linearVelocity=velocity, physicsClientId=client)
        self._touching, self._new, self._wrecks, self._left_s = frozenset(), [], [], 0.0

    def _build(self) -> list[int]:
        """Place hills and buildings; returns their bodies."""
        if self._obstacles is None:
            return []
        client, bodies = self._client, []
        for box in self._obstacles.boxes:
            half = [box.width / 2, box.depth / 2, box.roof / 2]
            shape = pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=half, physicsClientId=client)
            middle = [box.east, box.north, box.roof / 2]
            turned = [0.0, 0.0, math.sin(box.yaw / 2), math.cos(box.yaw / 2)]
            body = pybullet.createMultiBody(
                0, shape, basePosition=middle, baseOrientation=turned, physicsClientId=client
            )
            bodies.append(body)
        if self._obstacles.hills:
            bodies.append(self._raise_hills(self._obstacles.hills))
        for body in bodies:
            pybullet.setCollisionFilterGroupMask(body, -1, _OBSTACLE_GROUP, _BODY_GROUP, physicsClientId=client)
        return bodies

    def _raise_hills(self, hills: Hills) -> int:
        """A height field, which pybullet centers between its lowest and its highest point."""
        side = hills.heights.shape[0]
        shape = pybullet.createCollisionShape(
            pybullet.GEOM_HEIGHTFIELD, meshScale=[hills.cell_m, hills.cell_m, 1.0],
            heightfieldData=hills.heights.ravel().tolist(), numHeightfieldRows=side, numHeightfieldColumns=side,
            physicsClientId=self._client,
        )  # fmt: skip
        middle = float(hills.heights.max() + hills.heights.min()) / 2
        return int(pybullet.createMultiBody(0, shape, basePosition=[0, 0, middle], physicsClientId=self._client))

    def blocked(self, first: Rows, second: Rows) -> Flags:
        most = pybullet.MAX_RAY_INTERSECTION_BATCH_SIZE - 1
        hits: list[bool] = []
        for i in range(0, len(first), most):
            rays = pybullet.rayTestBatch(
                first[i : i + most].tolist(), second[i : i + most].tolist(), collisionFilterMask=_OBSTACLE_GROUP,
                physicsClientId=self._client,
            )  # fmt: skip
            hits += [ray[0] >= 0 for ray in rays]
        return np.array(hits, bool)

    def advance(self, dt_s: float, wanted_m_s: Rows) -> None:
        self._left_s += dt_s
        while self._left_s >= 1 / _CONTROL_HZ - 1e-9:
            self._left_s -= 1 / _CONTROL_HZ
            self._step(wanted_m_s)

    def _step(self, wanted_m_s: Rows) -> None:
        force = self._force(wanted_m_s).tolist()
        client, at = self._client, self._at.tolist()
        for body, push, place in zip(self._bodies, force, at, strict=True):
            pybullet.applyExternalForce(body, -1, push, place, pybullet.WORLD_FRAME, physicsClientId=client)
        pybullet.stepSimulation(physicsClientId=client)
        for i, body in enumerate(self._bodies):
            self._at[i] = pybullet.getBasePositionAndOrientation(body, physicsClientId=client)[0]
            self._velocity[i] = pybullet.getBaseVelocity(body, physicsClientId=client)[0]
        self._notice_contacts()

    def _force(self, wanted_m_s: Rows) -> Rows:
        """Thrust within its limits, plus drag [N]."""
        wish = _GAIN * (wanted_m_s - self._velocity) + _DRAG_N_S_M / MASS_KG * self._velocity
        thrust = MASS_KG * wish
        thrust[:, 2] = np.clip(thrust[:, 2] + MASS_KG * _GRAVITY, 0.2 * MASS_KG * _GRAVITY, _MAX_THRUST_N)
        sideways = np.linalg.norm(thrust[:, :2], axis=1)
        by_tilt = thrust[:, 2] * math.tan(_MAX_TILT)
        by_thrust = np.sqrt(np.maximum(0.0, _MAX_THRUST_N**2 - thrust[:, 2] ** 2))
        limit = np.minimum(by_tilt, by_thrust)
        thrust[:, :2] *= np.minimum(1.0, limit / np.maximum(sideways, 1e-9))[:, None]
        thrust[self._wrecks] = 0.0
        return np.asarray(thrust - _DRAG_N_S_M * self._velocity, dtype=np.float64)

    def _notice_contacts(self) -> None:
        points = pybullet.getContactPoints(physicsClientId=self._client) or ()
        touching = set()
        for point in points:
            pair = sorted((self._node_of[point[1]], self._node_of[point[2]]))
            if pair[0] != pair[1]:  # obstacles rest on the ground
                touching.add((pair[0], pair[1]))
        self._new += sorted(touching - self._touching)
        self._touching = frozenset(touching)

    def positions(self) -> Rows:
        return self._at

    def velocities(self) -> Rows:
        return self._velocity

    def fall(self, row: int) -> None:
        self._wrecks.append(row)

    def contacts(self) -> list[tuple[int, int]]:
        new, self._new = self._new, []
        return new

    def close(self) -> None:
        if self._client >= 0:
            pybullet.disconnect(physicsClientId=self._client)
            self._client = -1
