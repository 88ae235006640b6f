"""The physics model, dressed for pictures. It never steps, and no score depends on it.

Every physics shape is hidden and covered by shells that keep to its size, so that what seems to touch does touch.
"""

from __future__ import annotations

from functools import cache

import mujoco
import numpy as np

from dextron_bench.world import model
from dextron_bench.world.rendering.meshes import Section, Shell, loft

COLOURS = {  # Material: RGB, specular, shininess.
    "shell": ((0.90, 0.90, 0.88), 0.45, 0.6),
    "joint": ((0.13, 0.14, 0.16), 0.5, 0.5),
    "pad": ((0.20, 0.22, 0.25), 0.15, 0.2),
    "accent": ((0.03, 0.52, 0.55), 0.5, 0.6),
    "bottle": ((0.90, 0.36, 0.13), 0.8, 0.8),
    "label": ((0.95, 0.94, 0.90), 0.1, 0.1),
    "cap": ((0.10, 0.24, 0.30), 0.5, 0.5),
    "table": ((0.56, 0.62, 0.67), 0.1, 0.1),
}
SHOWN, HIDDEN = 1, 3  # Groups of shapes.
UNTOUCHABLE = {"contype": 0, "conaffinity": 0, "mass": 0, "group": SHOWN}
CUFF = -0.10  # [m] where the cuff ends, in the palm's y.


class _Dresser:
    """Adds shapes that weigh nothing and touch nothing to a model's specification."""

    def __init__(self, spec: mujoco.MjSpec) -> None:
        self.spec = spec
        self._shells = 0

    def shell(self, body: str, material: str, shell: Shell, pos: np.ndarray, quat: np.ndarray) -> None:
        """A surface in the body's frame."""
        name = f"shell_{self._shells}"
        self._shells += 1
        self.spec.add_mesh(
            name=name,
            uservert=shell.vertices.ravel(),
            userface=shell.faces.ravel(),
            inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
        )
        self._add(body, material, type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, pos=pos, quat=quat)

    def cylinder(self, body: str, material: str, radius: float, ends: np.ndarray) -> None:
        """A cylinder between two points (2, 3)."""
        self._add(body, material, type=mujoco.mjtGeom.mjGEOM_CYLINDER, size=[radius, 0, 0], fromto=ends.ravel())

    def ellipsoid(self, body: str, material: str, size: np.ndarray, pos: np.ndarray, quat: np.ndarray) -> None:
        """An ellipsoid by its half axes [m]."""
        self._add(body, material, type=mujoco.mjtGeom.mjGEOM_ELLIPSOID, size=size, pos=pos, quat=quat)

    def _add(self, body: str, material: str, **shape: object) -> None:
        self.spec.body(body).add_geom(material=material, **UNTOUCHABLE, **shape)


@cache
def visual_model() -> mujoco.MjModel:
    """The model for pictures, shared; its states are those of the physics model."""
    spec = mujoco.MjSpec.from_string(model.mjcf())
    for geom in spec.geoms:
        geom.group = HIDDEN
    for name, (rgb, specular, shininess) in COLOURS.items():
        spec.add_material(name=name, rgba=[*rgb, 1], specular=specular, shininess=shininess)
    _light(spec)
    dresser = _Dresser(spec)
    _table(spec)
    _bottle(dresser)
    _palm(dresser)
    for digit in model.DIGITS:
        for part in ("base", "proximal", "distal") if digit == "thumb" else ("proximal", "distal"):
            _digit_part(dresser, f"{digit}_{part}")
    return spec.compile()


def _light(spec: mujoco.MjSpec) -> None:
    """Studio light: a key that throws shadows, a fill and a rim that do not, a pale room."""
    spec.visual.headlight.ambient = [0.32, 0.32, 0.34]
    spec.visual.headlight.diffuse = [0.12, 0.12, 0.12]
    spec.visual.headlight.specular = [0.0, 0.0, 0.0]
    spec.visual.quality.shadowsize = 2048
    spec.visual.quality.offsamples, spec.visual.quality.numslices = 4, 64
    spec.stat.center, spec.stat.extent = [0, 0, 0.15], 1.5
    spec.visual.map.znear = 0.01
    spec.visual.map.zfar = 40
    spec.visual.map.shadowscale = 0.12
    spec.visual.global_.offwidth, spec.visual.global_.offheight = 2560, 1920
    lights = {"key": ((1.0, -3.2, 5.6), 0.66, True), "fill": ((3.0, 1.5, 1.8), 0.20, False)}
    lights["rim"] = ((-3.0, 1.6, 2.0), 0.20, False)
    for name, (pos, strength, shadow) in lights.items():
        light = spec.worldbody.add_light(name=name, pos=pos, dir=-np.array(pos), castshadow=shadow)
        kind = "SPOT" if shadow else "DIRECTIONAL"  # A spot's shadows stay crisp, and end without a seam.
        light.type = getattr(mujoco.mjtLightType, f"mjLIGHT_{kind}")
        light.cutoff, light.exponent = 75, 0
        light.diffuse, light.specular = [strength] * 3, [strength * 0.6] * 3
    spec.add_texture(
        name="room",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=[0.93, 0.95, 0.97],
        rgb2=[0.80, 0.84, 0.88],
        width=512,
        height=512,
    )


def _table(spec: mujoco.MjSpec) -> None:
    """A round tabletop with a rim, whose surface lies where the physics has it."""
    for radius, top, material in ((0.80, 0.0, "table"), (0.81, -0.004, "joint")):
        spec.worldbody.add_geom(
            material=material,
            type=mujoco.mjtGeom.mjGEOM_CYLINDER,
            size=[radius, 0.01, 0],
            pos=[0, 0, top - 0.01],
            **UNTOUCHABLE,
        )


def _bottle(dresser: _Dresser) -> None:
    """Base, body, shoulder and neck in one surface; cap and label around it."""
    still = np.array([1.0, 0, 0, 0])
    profile = [(-0.1245, 0.0215), (-0.122, 0.0235), (-0.117, 0.0246), (-0.11, 0.025), (0.055, 0.025), (0.066, 0.0242)]
    profile += [(0.077, 0.0215), (0.088, 0.0165), (0.096, 0.0128), (0.101, 0.0115), (0.112, 0.0112)]
    body = loft([Section(z, r, r) for z, r in profile], domes=(0.0005, 0.0))
    dresser.shell("bottle", "bottle", body, np.zeros(3), still)
    cap = loft([Section(0.106, 0.0130, 0.0130), Section(0.122, 0.0130, 0.0130)], domes=(0.0005, 0.003))
    dresser.shell("bottle", "cap", cap, np.zeros(3), still)
    dresser.cylinder("bottle", "label", 0.0253, np.array([[0, 0, -0.075], [0, 0, 0.025]]))
    for z in (-0.070, 0.017):
        dresser.cylinder("bottle", "cap", 0.0255, np.array([[0, 0, z], [0, 0, z + 0.003]]))


def _palm(dresser: _Dresser) -> None:
    """Back of the hand, thenar, wrist and cuff, lofted along the palm's y from the cuff to the knuckles."""
    along_y = _turn(np.array([1.0, 0, 0]), np.array([0, 1.0, 0]))  # Section x is the palm's x, section y is its -z.
    at = np.zeros(3)
    hand = [
        Section(0.006, 0.0235, 0.0170, -0.003, 0.0),
        Section(0.022, 0.0285, 0.0180, -0.004, 0.0),
        Section(0.050, 0.0350, 0.0175, -0.004, 0.0),
        Section(0.080, 0.0400, 0.0160, -0.004, 0.0005),
        Section(0.096, 0.0410, 0.0135, -0.004, 0.001),
    ]
    dresser.shell("palm", "shell", loft(hand, 2.8, (0.008, 0.012)), at, along_y)
    inside = [Section(0.030, 0.020, 0.004, -0.004, -0.0160), Section(0.060, 0.027, 0.005, -0.004, -0.0155)]
    inside += [Section(0.090, 0.032, 0.004, -0.004, -0.0125)]
    dresser.shell("palm", "pad", loft(inside, 2.4, (0.008, 0.006)), at, along_y)
    wrist = [Section(-0.014, 0.0225, 0.0165, -0.003), Section(0.002, 0.0225, 0.0165, -0.003)]
    dresser.shell("palm", "joint", loft(wrist, 2.2), at, along_y)
    ring = [Section(-0.021, 0.0265, 0.0215, -0.003), Section(-0.014, 0.0265, 0.0215, -0.003)]
    dresser.shell("palm", "accent", loft(ring, 2.1, (0.001, 0.001)), at, along_y)
    cuff = [
        Section(CUFF, 0.034, 0.030, -0.003),
        Section(-0.06, 0.032, 0.027, -0.003),
        Section(-0.022, 0.0275, 0.0225, -0.003),
    ]
    dresser.shell("palm", "shell", loft(cuff, 2.1, (0.001, 0.001)), at, along_y)
    socket = [Section(CUFF - 0.004, 0.031, 0.027, -0.003), Section(CUFF, 0.031, 0.027, -0.003)]
    dresser.shell("palm", "joint", loft(socket, 2.1, (0.004, 0.0)), at, along_y)


def _digit_part(dresser: _Dresser, name: str) -> None:
    """One part of a digit: its physics capsule for a shell, a hinge and, at the tip, a soft pad on the inside."""
    physics = model.load().geom(name)
    radius, half = physics.size[:2]
    shell = dresser.spec.geom(name)
    shell.group, shell.material = SHOWN, "shell"
    hinge = np.array([0.0, 0.0, 1.0])
    dresser.cylinder(name, "joint", radius * 0.95, np.array([-hinge, hinge]) * radius * 1.12)
    if name.endswith("distal"):
        axis = -_matrix(physics.quat)[:, 2]  # MuJoCo's capsules point from `to` to `from`.
        inside = np.cross(hinge, axis) * (-1 if name.startswith("thumb") else 1)
        pad = physics.pos + axis * half * 0.55 + inside * radius * 0.38
        dresser.ellipsoid(name, "pad", np.array([0.78, 0.78, 1.5]) * radius, pad, _turn(hinge, axis))


def _turn(x: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Quaternion of the frame with that x (made square to z) and z, given in the parent's frame."""
    z = z / np.linalg.norm(z)
    x = x - z * (x @ z)
    x = x / np.linalg.norm(x)
    quat = np.empty(4)
    mujoco.mju_mat2Quat(quat, np.stack([x, np.cross(z, x), z], axis=1).ravel())
    return quat


def _matrix(quat: np.ndarray) -> np.ndarray:
    matrix = np.empty(9)
    mujoco.mju_quat2Mat(matrix, quat)
    return matrix.reshape(3, 3)
