"""The visual model: the physics model with detailed surfaces, for pictures. It is never stepped, and no score uses it.

The collision shapes of the hand are shown as they are, so that contacts look right, with hinges, pads, a wrist and a
cuff. Visual shapes of the same size replace the bottle and the table.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from dextron_bench.reaches import rotation
from dextron_bench.world import model
from dextron_bench.world.rendering.meshes import Mesh, Section, loft
from dextron_bench.world.simulator import mujoco

COLOURS = {  # RGB, specular and shininess of each material.
    "shell": ((0.90, 0.90, 0.88), 0.45, 0.6),
    "joint": ((0.13, 0.14, 0.16), 0.5, 0.5),
    "pad": ((0.20, 0.22, 0.25), 0.15, 0.2),
    "accent": ((0.03, 0.52, 0.55), 0.5, 0.6),
    "bottle": ((0.90, 0.36, 0.13), 0.8, 0.8),
    "label": ((0.95, 0.94, 0.90), 0.1, 0.1),
    "cap": ((0.10, 0.24, 0.30), 0.5, 0.5),
    "table": ((0.56, 0.62, 0.67), 0.1, 0.1),
}
SHOWN, HIDDEN = 1, 3  # Groups of geoms.
VISUAL_ONLY = {"contype": 0, "conaffinity": 0, "mass": 0, "group": SHOWN}
CUFF = -0.10  # [m] y of the end of the cuff in the palm's frame.
UNTURNED = np.array([1.0, 0.0, 0.0, 0.0])
HINGE_RADIUS, HINGE_MARGIN = 0.0042, 0.0006  # [m] radius of a hinge, and how far it stands out at each side.
PAD_START, PAD_SCALE, PAD_RISE = 0.35, 0.85, 0.0009  # Of the length; of the size; [m].


class _ShapeAdder:
    """Adds shapes without mass and contacts to the specification of a model."""

    def __init__(self, spec: mujoco.MjSpec) -> None:
        self.spec = spec
        self._meshes = 0

    def show(self, geom: str) -> None:
        """Shows a collision shape of the hand."""
        shape = self.spec.geom(geom)
        shape.group, shape.material = SHOWN, "shell"

    def mesh(self, body: str, material: str, mesh: Mesh, pos: np.ndarray, quat: np.ndarray) -> None:
        """Adds a closed surface, given in the body's frame."""
        faces = {"userface": mesh.faces.ravel(), "inertia": mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL}
        self._add_mesh(body, material, pos, quat, uservert=mesh.vertices.ravel(), **faces)

    def hull(self, body: str, material: str, vertices: np.ndarray) -> None:
        """Adds the convex hull of vertices (n, 3) in the body's frame."""
        self._add_mesh(body, material, np.zeros(3), UNTURNED, uservert=vertices.ravel())

    def cylinder(self, body: str, material: str, radius: float, ends: np.ndarray) -> None:
        """Adds a cylinder of a radius [m] between two points [m] (2, 3)."""
        self._add(body, material, type=mujoco.mjtGeom.mjGEOM_CYLINDER, size=[radius, 0, 0], fromto=ends.ravel())

    def _add_mesh(self, body: str, material: str, pos: np.ndarray, quat: np.ndarray, **content: object) -> None:
        name = f"shell_{self._meshes}"
        self._meshes += 1
        self.spec.add_mesh(name=name, **content)
        self._add(body, material, type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, pos=pos, quat=quat)

    def _add(self, body: str, material: str, **shape: object) -> None:
        self.spec.body(body).add_geom(material=material, **VISUAL_ONLY, **shape)


@cache
def visual_model() -> mujoco.MjModel:
    """The compiled visual model, which all callers share. Its states are the states of the physics model."""
    spec = mujoco.MjSpec.from_string(model.mjcf())
    for geom in spec.geoms:
        geom.group = HIDDEN
    for name, (rgb, specular, shininess) in COLOURS.items():
        spec.add_material(name=name, rgba=[*rgb, 1], specular=specular, shininess=shininess)
    _add_lights(spec)
    shapes = _ShapeAdder(spec)
    _add_table(spec)
    _add_bottle(shapes)
    _add_palm(shapes)
    for digit in model.DIGITS:
        for part in ("base", "proximal", "distal") if digit == "thumb" else ("proximal", "distal"):
            _add_digit_part(shapes, f"{digit}_{part}")
    return spec.compile()


def _add_lights(spec: mujoco.MjSpec) -> None:  # Long because it is a list of settings.
    """Adds a key light that casts shadows, a fill and a rim light that do not, and a pale background."""
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
        kind = "SPOT" if shadow else "DIRECTIONAL"  # The shadow of a spot is sharp and has no visible edge.
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


def _add_table(spec: mujoco.MjSpec) -> None:
    """Adds a round tabletop with a rim. Its surface is at the height of the physics model's table."""
    for radius, top, material in ((0.80, 0.0, "table"), (0.81, -0.004, "joint")):
        spec.worldbody.add_geom(
            material=material,
            type=mujoco.mjtGeom.mjGEOM_CYLINDER,
            size=[radius, 0.01, 0],
            pos=[0, 0, top - 0.01],
            **VISUAL_ONLY,
        )


def _add_bottle(shapes: _ShapeAdder) -> None:
    """Adds one surface for the base, body, shoulder and neck of the bottle, then its cap and label."""
    unrotated = np.array([1.0, 0, 0, 0])
    profile = [(-0.1245, 0.0215), (-0.122, 0.0235), (-0.117, 0.0246), (-0.11, 0.025), (0.055, 0.025), (0.066, 0.0242)]
    profile += [(0.077, 0.0215), (0.088, 0.0165), (0.096, 0.0128), (0.101, 0.0115), (0.112, 0.0112)]
    body = loft([Section(z, r, r) for z, r in profile], domes=(0.0005, 0.0))
    shapes.mesh("bottle", "bottle", body, np.zeros(3), unrotated)
    cap = loft([Section(0.106, 0.0130, 0.0130), Section(0.122, 0.0130, 0.0130)], domes=(0.0005, 0.003))
    shapes.mesh("bottle", "cap", cap, np.zeros(3), unrotated)
    shapes.cylinder("bottle", "label", 0.0253, np.array([[0, 0, -0.075], [0, 0, 0.025]]))
    for z in (-0.070, 0.017):
        shapes.cylinder("bottle", "cap", 0.0255, np.array([[0, 0, z], [0, 0, z + 0.003]]))


def _add_palm(shapes: _ShapeAdder) -> None:
    """Shows the palm's collision shape, and adds the wrist and the cuff, lofted along the palm's y."""
    shapes.show("palm")
    # A section's x is the palm's x, and a section's y is the palm's -z.
    along_y = _frame_quaternion(np.array([1.0, 0, 0]), np.array([0, 1.0, 0]))
    origin = np.zeros(3)
    wrist = [Section(-0.014, 0.0225, 0.0165, -0.003), Section(0.006, 0.0205, 0.0155, -0.002)]
    shapes.mesh("palm", "joint", loft(wrist, 2.2), origin, along_y)
    ring = [Section(-0.021, 0.0265, 0.0215, -0.003), Section(-0.014, 0.0265, 0.0215, -0.003)]
    shapes.mesh("palm", "accent", loft(ring, 2.1, (0.001, 0.001)), origin, along_y)
    cuff = [
        Section(CUFF, 0.034, 0.030, -0.003),
        Section(-0.06, 0.032, 0.027, -0.003),
        Section(-0.022, 0.0275, 0.0225, -0.003),
    ]
    shapes.mesh("palm", "shell", loft(cuff, 2.1, (0.001, 0.001)), origin, along_y)
    socket = [Section(CUFF - 0.004, 0.031, 0.027, -0.003), Section(CUFF, 0.031, 0.027, -0.003)]
    shapes.mesh("palm", "joint", loft(socket, 2.1, (0.004, 0.0)), origin, along_y)


def _add_digit_part(shapes: _ShapeAdder, name: str) -> None:
    """Shows the collision shape of one part of a digit, and adds a hinge and, on the inside of a tip, a soft pad."""
    shapes.show(name)
    physics = model.load()
    vertices = mesh_vertices(physics, physics.geom(name).id)
    nearest = np.argmin(np.linalg.norm(vertices[:, :2], axis=1))
    half = abs(vertices[nearest, 2]) + HINGE_MARGIN
    shapes.cylinder(name, "joint", HINGE_RADIUS, np.array([[0, 0, -half], [0, 0, half]]))
    if name.endswith("distal"):
        shapes.hull(name, "pad", _pad(vertices, inside=-1.0 if name.startswith("thumb") else 1.0))


def _pad(vertices: np.ndarray, inside: float) -> np.ndarray:
    """The corners (n, 3) of a pad on a fingertip with these vertices (n, 3): the inside of its outer half, moved out.

    `inside` is 1 if a positive rotation about z closes the digit, and -1 otherwise.
    """
    tip = vertices[np.argmax(np.linalg.norm(vertices[:, :2], axis=1))] * [1.0, 1.0, 0.0]
    along = tip / np.linalg.norm(tip)
    inward = np.cross([0.0, 0.0, inside], along)
    length, depth = vertices @ along, vertices @ inward
    outer = length > PAD_START * length.max()
    patch = vertices[outer & (depth > np.median(depth[outer]))]
    return patch.mean(axis=0) + PAD_SCALE * (patch - patch.mean(axis=0)) + PAD_RISE * inward


def mesh_vertices(compiled: mujoco.MjModel, geom: int) -> np.ndarray:
    """The vertices (n, 3) [m] of a geom's mesh, in the frame of the geom's body."""
    mesh = compiled.geom_dataid[geom]
    vertices = compiled.mesh_vert[compiled.mesh_vertadr[mesh] :][: compiled.mesh_vertnum[mesh]]
    turn = np.broadcast_to(compiled.geom_quat[geom], (len(vertices), 4))
    return compiled.geom_pos[geom] + rotation.rotate(turn, vertices)


def _frame_quaternion(x: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Quaternion (4,) of the frame with this z axis and with its x axis nearest to this x, in the parent's frame."""
    z = z / np.linalg.norm(z)
    x = x - z * (x @ z)
    x = x / np.linalg.norm(x)
    quat = np.empty(4)
    mujoco.mju_mat2Quat(quat, np.stack([x, np.cross(z, x), z], axis=1).ravel())
    return quat
