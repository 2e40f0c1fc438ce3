"""Rigid bodies in pybullet: mass, gravity, drag, limited thrust, collisions between bodies and with the ground.

Each multirotor is an upright disc under a thrust vector. The attitude loop, ten times faster than the velocity loop, is
taken as ideal within the tilt limit, so no hit turns a body over. Contacts between bodies are those of their closest
approach within a step (`contacts.py`), and those that the physics sees. Not modeled: rotor dynamics, wind, ground
effect, downwash.

Pybullet keeps an external force over the substeps of one step, so the thrust is set at 60 Hz while contacts and motion
are solved at `physics_hz`.
"""

import math
from typing import Final

import numpy as np

from sim.world.arrays import Rows
from sim.world.engines.contacts import Contacts
from sim.world.engines.contract import Engine
from sim.world.engines.quiet_pybullet import pybullet
from sim.world.engines.rotors.vehicle_types import IRIS
from sim.world.environment.obstacles import Hills, Obstacles
from sim.world.environment.solids import Solids

MASS_KG: Final = 1.5
_HEIGHT_M: Final = 0.1
_GRAVITY: Final = 9.81
_MAX_THRUST_N: Final = 2.0 * MASS_KG * _GRAVITY
_MAX_TILT: Final = math.radians(35)
_DRAG_N_S_M: Final = 0.25
"""Linear drag; at 15 m/s it is a quarter of the weight, as for a small quadrotor."""
_GAIN: Final = 2.5
"""The gain of the velocity loop [1/s]."""
_CONTROL_HZ: Final = 60
_MARGIN_M: Final = 2.0
"""Contacts are looked for while bodies are nearer to something than this: more than any manoeuvre changes in 0.1 s."""
_OBSTACLE_GROUP: Final = 64
"""The collision group of hills and buildings: they collide with bodies, but not with the ground or each other."""
_BODY_GROUP: Final = 1


class Physics(Engine):
    """pybullet in DIRECT mode: no window, no display."""

    name = "pybullet"

    def __init__(self, *, physics_hz: int, obstacles: Obstacles | None = None) -> None:
        self._client = pybullet.connect(pybullet.DIRECT)
        self._substeps = max(1, round(physics_hz / _CONTROL_HZ))
        self._obstacles = obstacles
        self._solids = Solids(obstacles)
        self._contacts = Contacts(IRIS.reach_m, self._solids if self._solids.any else None)
        self._watches = True
        """True if anything may touch anything in the steps of this `advance`."""
        self._left_s = 0.0
        self._bodies: list[int] = []
        self._node_of: dict[int, int] = {}
        self._at = np.zeros((0, 3))
        self._velocity = np.zeros((0, 3))
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
            pybullet.GEOM_CYLINDER, radius=IRIS.reach_m, height=_HEIGHT_M, physicsClientId=client
        )
        self._bodies = [
            pybullet.createMultiBody(MASS_KG, hull, basePosition=at.tolist(), physicsClientId=client)
            for at in positions
        ]
        for body in self._bodies:
            pybullet.changeDynamics(
                body, -1, linearDamping=0, localInertiaDiagonal=[0.0, 0.0, 0.0],
                activationState=pybullet.ACTIVATION_STATE_DISABLE_SLEEPING, physicsClientId=client,
            )  # fmt: skip
        solid = [ground, *self._build()]
        self._node_of = dict.fromkeys(solid, 0) | {body: i + 1 for i, body in enumerate(self._bodies)}
        self._at = positions.copy()
        self._velocity = np.zeros_like(positions) if velocities is None else velocities.copy()
        for body, velocity in zip(self._bodies, self._velocity.tolist(), strict=True):
            pybullet.resetBaseVelocity(body, linearVelocity=velocity, physicsClientId=client)
        self._wrecks, self._left_s = [], 0.0
        self._contacts.reset()

    def _build(self) -> list[int]:
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
        corners, triangles = hills.mesh()
        shape = pybullet.createCollisionShape(
            pybullet.GEOM_MESH, vertices=corners.tolist(), indices=triangles.ravel().tolist(),
            physicsClientId=self._client,
        )  # fmt: skip
        return int(pybullet.createMultiBody(0, shape, physicsClientId=self._client))

    def advance(self, dt_s: float, wanted_m_s: Rows) -> None:
        self._left_s += dt_s
        self._watches = self._contacts.possible(self._at, self._at + self._velocity * dt_s, margin_m=_MARGIN_M)
        while self._left_s >= 1 / _CONTROL_HZ - 1e-9:
            self._left_s -= 1 / _CONTROL_HZ
            self._step(wanted_m_s)

    def _step(self, wanted_m_s: Rows) -> None:
        force = self._force(wanted_m_s).tolist()
        client, at = self._client, self._at.tolist()
        for body, push, place in zip(self._bodies, force, at, strict=True):
            pybullet.applyExternalForce(body, -1, push, place, pybullet.WORLD_FRAME, physicsClientId=client)
        before, free = self._at.copy(), self._at + self._velocity / _CONTROL_HZ
        pybullet.stepSimulation(physicsClientId=client)
        for i, body in enumerate(self._bodies):
            self._at[i] = pybullet.getBasePositionAndOrientation(body, physicsClientId=client)[0]
            self._velocity[i] = pybullet.getBaseVelocity(body, physicsClientId=client)[0]
        if self._watches:
            self._lift_out()
            # where they would have flown: bodies that bounce within a step are apart again at its end
            self._contacts.notice(before, free, self._touching())

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

    def _lift_out(self) -> None:
        """Put those bodies back on the ground that have passed through it within a step, which no triangle prevents."""
        ground = self._solids.ground_m(self._at)
        for row in np.flatnonzero(self._at[:, 2] < ground).tolist():
            self._at[row, 2] = ground[row] + _HEIGHT_M / 2
            self._velocity[row] = 0.0
            pybullet.resetBasePositionAndOrientation(
                self._bodies[row], self._at[row].tolist(), [0.0, 0.0, 0.0, 1.0], physicsClientId=self._client
            )

    def _touching(self) -> frozenset[tuple[int, int]]:
        """The bodies that touch by the physics; obstacles rest on the ground, which does not count."""
        points = pybullet.getContactPoints(physicsClientId=self._client) or ()
        pairs = {(self._node_of[point[1]], self._node_of[point[2]]) for point in points}
        return frozenset((min(pair), max(pair)) for pair in pairs if pair[0] != pair[1])

    def close(self) -> None:
        if self._client >= 0:
            pybullet.disconnect(physicsClientId=self._client)
            self._client = -1
