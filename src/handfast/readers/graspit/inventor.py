"""Inventor and VRML files in, triangle meshes out: the ASCII scene graphs that GraspIt! keeps its geometry in.

Solids and surfaces are read, with the transforms above them; colours, texts, lines and cameras are passed over; what
else could be a surface (NURBS, prototypes, scripts) is refused by name. Formats: The Inventor Mentor (1994) with its
reference of nodes, and ISO/IEC 14772 (VRML97).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from handfast.core.arrays import Array
from handfast.core.errors import FaultsOf, InputError
from handfast.core.transforms import transform
from handfast.model.shape import Faces, Mesh
from handfast.readers.graspit.scene_graph import SceneNode, parse_scene_graph

MAX_INVENTOR_BYTES = 1 << 26  # [bytes] of a file
MAX_FILE_DEPTH = 8  # files that refer to files
MAX_VISITED_NODES = 10_000  # nodes that are visited: a node that is used again is visited again
IDENTITY = tuple(np.eye(4).ravel())
SECTIONS = 48  # sides of a cylinder or cone

SCOPES = {"Separator", "TransformSeparator", "Annotation", "Anchor", "WWWAnchor", "Collision", "Billboard", "Shape"}
SILENT_NODES = """
    Appearance AsciiText Background BaseColor Color ColorRGBA Complexity Coordinate DirectionalLight DrawStyle
    Environment EventCallback Fog Font FontStyle ImageTexture IndexedLineSet IndexedPointSet Info Label
    LightModel LineSet Material MaterialBinding NavigationInfo Normal NormalBinding OrthographicCamera
    PerspectiveCamera PickStyle PixelTexture PointLight PointSet PolygonOffset SpotLight Text Text2 Text3
    Texture2 Texture2Transform TextureCoordinate TextureCoordinate2 TextureCoordinateBinding TextureTransform
    TimeSensor Viewpoint WorldInfo
"""
SILENT = frozenset(SILENT_NODES.split())


@dataclass
class _State:
    """What the nodes that were passed leave behind for those that follow."""

    pose: Array  # (4, 4), not rigid in general: transforms scale
    points: Array | None = None  # (n, 3) of the last Coordinate3
    clockwise: bool = False


def read_inventor(path: Path) -> list[Mesh]:
    """The surfaces of an ASCII Inventor (.iv) or VRML 1 or 2 (.wrl) file, one mesh for each shape node; [] without any.

    Vertices (n, 3) are in the file's units and its root's frame, duplicates merged. Polygons are cut into triangles
    from their first corner. Cylinders and cones have `SECTIONS` sides.

    Raises:
        InputError: no such file, a binary or compressed one, not the format, a node that is not read, corners that
            are no vertices, vertices that are NaN or infinite. One line, naming the file.
    """
    reader = _Reader()
    with FaultsOf(path), np.errstate(all="ignore"):  # what overflows is infinite, and refused
        reader.file(path, _State(np.eye(4)))
    return reader.groups


class _Reader:
    def __init__(self) -> None:
        self.groups: list[Mesh] = []
        self.visited = self.deep = 0
        self.path = Path()

    def file(self, path: Path, state: _State) -> None:
        try:
            data = path.read_bytes() if path.stat().st_size <= MAX_INVENTOR_BYTES else None
        except OSError as fault:
            raise InputError(f"cannot be read ({fault.strerror})", source=str(path)) from None
        if data is None:
            raise InputError(f"is larger than {MAX_INVENTOR_BYTES >> 20} MiB", source=str(path))
        first = data[:60].split(b"\n")[0].strip()
        if not ((first.startswith(b"#Inventor V") and b"ascii" in first) or first.startswith(b"#VRML V")):
            right = "ASCII Inventor (#Inventor V2.1 ascii) and VRML (#VRML V1.0 ascii, #VRML V2.0 utf8) are read"
            raise InputError(f"begins with {first[:40].decode('latin-1')!r}; {right}", source=str(path))
        nodes = parse_scene_graph(data.decode("utf-8", "replace"))
        outer, self.path = self.path, path
        vrml2 = first.startswith(b"#VRML V2")
        for node in nodes:
            self.visit(node, state, vrml2)
        self.path = outer

    def visit(self, node: SceneNode, state: _State, vrml2: bool) -> None:
        self.visited += 1
        if self.visited > MAX_VISITED_NODES:
            raise InputError(f"has more than {MAX_VISITED_NODES} nodes, those that are used again counted again")
        kind = node.kind
        if kind in SILENT:
            return
        if kind in SCOPES or (vrml2 and kind in ("Transform", "Group")):
            state = replace(state)
            if kind == "Transform":
                state.pose = state.pose @ _placed(node)
            inner = [*node.children, *node.nodes("children"), *node.nodes("geometry")]
        elif kind in ("Group", "Switch", "LOD", "LevelOfDetail"):
            inner = _chosen(node)
        elif kind == "ShapeHints":
            order = node.word("vertexOrdering")
            state.clockwise = order == "CLOCKWISE" if order else state.clockwise
            return
        elif kind == "File":
            return self.included(node, state)
        elif kind in ("Coordinate3", "VertexProperty"):
            state.points = node.table("point" if kind == "Coordinate3" else "vertex")
            return
        elif kind in NODE_TRANSFORMS:
            state.pose = state.pose @ NODE_TRANSFORMS[kind](node)
            return
        elif kind in NODE_MESHES:
            return self.add(node, state, *NODE_MESHES[kind](node, state))
        else:
            raise InputError(f"has a node {kind}, which is not read; save the mesh as OBJ, STL, PLY or OFF")
        for child in inner:
            self.visit(child, state, vrml2)

    def included(self, node: SceneNode, state: _State) -> None:
        name = node.word("name")
        if not name or Path(name).is_absolute() or "://" in name:
            raise InputError(f"refers to the file '{name}'; a relative path is needed")
        if self.deep >= MAX_FILE_DEPTH:
            raise InputError(f"refers to files that refer to files, more than {MAX_FILE_DEPTH} deep")
        self.deep += 1
        self.file(self.path.parent / name.replace("\\", "/"), replace(state))
        self.deep -= 1

    def add(self, node: SceneNode, state: _State, vertices: Array, faces: Faces) -> None:
        if not len(faces):
            return
        if faces.min() < 0 or faces.max() >= len(vertices):
            raise InputError(f"has a corner that is none of its {len(vertices)} vertices", field=node.kind)
        placed = vertices @ state.pose[:3, :3].T + state.pose[:3, 3]
        if not np.isfinite(placed).all():
            raise InputError("has a vertex that is NaN or infinite", field=node.kind)
        backwards = (node.word("ccw") == "FALSE" or state.clockwise) != (np.linalg.det(state.pose[:3, :3]) < 0)
        unique, inverse = np.unique(placed, axis=0, return_inverse=True)
        triangles = inverse.reshape(-1)[faces]
        self.groups.append((unique, triangles[:, ::-1] if backwards else triangles))


def _chosen(node: SceneNode) -> list[SceneNode]:
    """The children that count: all of a group, the chosen one of a switch (none by default), the finest level."""
    inner = [*node.children, *node.nodes("children"), *node.nodes("choice"), *node.nodes("level")]
    if node.kind == "Group":
        return inner
    if node.kind in ("LOD", "LevelOfDetail"):
        return inner[:1]
    which = int(node.numbers("whichChild" if node.field("whichChild") else "whichChoice", 1, (-1,))[0])
    return inner if which == -3 else inner[which : which + 1] if which >= 0 else []


def _turned(axis: Array, angle: float) -> Array:
    from scipy.spatial.transform import Rotation

    length = np.linalg.norm(axis)
    return transform(np.zeros(3), Rotation.from_rotvec(axis / length * angle).as_matrix()) if length else np.eye(4)


def _scaled(factors: Array) -> Array:
    return np.diag([*factors, 1.0])


def _placed(node: SceneNode) -> Array:
    """(4, 4) of a Transform: scale along its own axes, turn about a centre, move."""
    center = node.numbers("center", 3, (0, 0, 0))
    turn = node.numbers("rotation", 4, (0, 0, 1, 0))
    along = node.numbers("scaleOrientation", 4, (0, 0, 1, 0))
    scale = node.numbers("scaleFactor" if node.field("scaleFactor") else "scale", 3, (1, 1, 1))
    turned, tilted = _turned(turn[:3], turn[3]), _turned(along[:3], along[3])
    stretch = tilted @ _scaled(scale) @ tilted.T
    return np.asarray(
        transform(node.numbers("translation", 3, (0, 0, 0)) + center) @ turned @ stretch @ transform(-center)
    )


def _rotation(node: SceneNode) -> Array:
    turn = node.numbers("rotation", 4, (0, 0, 1, 0))
    return _turned(turn[:3], turn[3])


def _rotation_xyz(node: SceneNode) -> Array:
    axis = (node.word("axis") or "X").upper()
    if axis not in ("X", "Y", "Z"):
        raise InputError(f"has axis '{axis}'; X, Y or Z is needed", field="RotationXYZ")
    return _turned(np.eye(3)["XYZ".index(axis)], node.numbers("angle", 1, (0,))[0])


NODE_TRANSFORMS: dict[str, Callable[[SceneNode], Array]] = {
    "Transform": _placed,
    "Translation": lambda node: transform(node.numbers("translation", 3, (0, 0, 0))),
    "Rotation": _rotation,
    "RotationXYZ": _rotation_xyz,
    "Scale": lambda node: _scaled(node.numbers("scaleFactor", 3, (1, 1, 1))),
    "MatrixTransform": lambda node: node.numbers("matrix", 16, IDENTITY).reshape(4, 4).T,  # the file's multiplies rows
}


def _points(node: SceneNode, state: _State) -> Array:
    """The vertices that a node refers to: its own, or those that were stated before."""
    for field, name in (("coord", "point"), ("vertexProperty", "vertex")):
        for own in node.nodes(field):
            return own.table(name)
    if state.points is None:
        raise InputError("has no vertices", field=node.kind)
    return state.points


def _counted(cut: Callable[[list[list[int]]], Faces]) -> Callable[[SceneNode, _State], Mesh]:
    """Of a set whose vertices follow each other: `numVertices` of each piece, -1 for all that are left."""

    def read(node: SceneNode, state: _State) -> Mesh:
        points, runs = _points(node, state), []
        at = int(node.numbers("startIndex", 1, (0,))[0])
        for n in node.integers("numVertices") or [-1]:
            end = len(points) if n < 0 else at + n
            if end > len(points):  # before a list of that length is made
                raise InputError(f"has a corner that is none of its {len(points)} vertices", field=node.kind)
            runs.append(list(range(at, end)))
            at = end
        return points, cut(runs)

    return read


def _runs(index: list[int]) -> list[list[int]]:
    """Indices cut at each -1."""
    runs: list[list[int]] = [[]]
    for i in index:
        if i == -1:
            runs.append([])
        else:
            runs[-1].append(i)
    return runs


def _fans(runs: list[list[int]]) -> Faces:
    triangles = [(r[0], r[i], r[i + 1]) for r in runs for i in range(1, len(r) - 1)]
    return np.array(triangles, dtype=np.int64).reshape(-1, 3)


def _bands(runs: list[list[int]]) -> Faces:
    """Faces of strips; every second one is wound the other way."""
    turns = [(r[i], r[i + 1 + i % 2], r[i + 2 - i % 2]) for r in runs for i in range(len(r) - 2)]
    return np.array(turns, dtype=np.int64).reshape(-1, 3)


def _solid(node: SceneNode, state: _State) -> Mesh:
    """A box, ball, cylinder or cone about the origin; the latter two along y."""
    import trimesh  # slow to import

    def size(name: str, default: float) -> float:
        value = float(node.numbers(name, 1, (default,))[0])
        if not 0 < value < 1e50:
            raise InputError(f"is {value:g}; a size is positive and finite", field=f"{node.kind}.{name}")
        return value

    match node.kind:
        case "Cube":
            mesh = trimesh.creation.box([size("width", 2), size("height", 2), size("depth", 2)])
        case "Box":
            mesh = trimesh.creation.box(node.numbers("size", 3, (2, 2, 2)))
        case "Sphere":
            mesh = trimesh.creation.icosphere(subdivisions=3, radius=size("radius", 1))
        case "Cylinder":
            mesh = trimesh.creation.cylinder(size("radius", 1), size("height", 2), sections=SECTIONS)
        case _:
            height = size("height", 2)
            mesh = trimesh.creation.cone(size("bottomRadius", 1), height, sections=SECTIONS)
            mesh.apply_translation([0, 0, -height / 2])
    vertices = np.asarray(mesh.vertices, dtype=float)
    if node.kind in ("Cylinder", "Cone"):
        vertices = vertices[:, [1, 2, 0]]  # a turn that takes z to y
    return vertices, np.asarray(mesh.faces, dtype=np.int64)


NODE_MESHES: dict[str, Callable[[SceneNode, _State], Mesh]] = {
    "IndexedFaceSet": lambda node, state: (_points(node, state), _fans(_runs(node.integers("coordIndex")))),
    "IndexedTriangleStripSet": lambda node, state: (_points(node, state), _bands(_runs(node.integers("coordIndex")))),
    "FaceSet": _counted(_fans),
    "TriangleStripSet": _counted(_bands),
    **dict.fromkeys(("Cube", "Box", "Sphere", "Cylinder", "Cone"), _solid),
}
