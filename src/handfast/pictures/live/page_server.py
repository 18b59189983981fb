"""The page on viser: its scene, its panel, and what the mouse does. No other module knows viser."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from typing import Any

import numpy as np

from handfast.core.errors import InputError
from handfast.core.transforms import matrix_quaternion, quaternion_matrix
from handfast.pictures import words
from handfast.pictures.camera import first_hit
from handfast.pictures.live.answering import Reply
from handfast.pictures.live.dressed_page import dressed
from handfast.pictures.live.live_session import LiveSession
from handfast.pictures.live.page_text import map_svg, verdict_html
from handfast.pictures.live.same_origin import Doorkeeper
from handfast.pictures.live.shown_state import CURVE, FORCE_COLOR, GREY, Shown, ShownMap, SlipMotion
from handfast.pictures.live.view_state import LOAD_ARROW, MAP_PLANES, MIN_LOAD, Stage, ViewState

STEEL, FINGER_COLOR, CONE_COLOR, OBJECT_OPACITY = (158, 171, 186), (194, 200, 207), (44, 125, 79), 0.55
MOST_FRICTION, MOST_TILT, MOST_PRELOAD = 2.0, 15.0, 3.0  # ends of sliders: coefficient, degrees, times the file's
LOCKED_REACH = {"N·m": 0.5, "N": 20.0}  # end of the slider of an actuator in a grasp without commands
HELP = """**Turn** the load with the rings, **shift** where it acts with the arrows of the handle.
**Drag** the ball at its tip: direction and size.
**Ctrl + right button** on the object: a force, from where you grab it. **Ctrl + left**: a torque.
Left button: look around; right: shift; wheel: zoom."""


class PageServer:
    """A session on a page: call `stop` in the end.

    Args:
        host, port: where it listens; the port has to be free.

    Raises:
        InputError: viser is not installed, or a version of it that cannot be guarded.
    """

    def __init__(self, session: LiveSession, host: str, port: int) -> None:
        self.session = session
        self._server = _listening(host, port)
        self.host, self.port = host, int(self._server.get_port())
        self._scene, self._gui = self._server.scene, self._server.gui
        self._gui.configure_theme(show_logo=False, show_share_button=False, brand_color=(47, 109, 179))
        self._gui.set_panel_label("handfast view")
        self._nodes: dict[str, Any] = {}
        self._preloads: list[Any] = []
        self._moved = False
        self._start: tuple[Any, Any, Any, float] | None = None  # of a gesture: see `_dragged`
        self._panel()

    @property
    def url(self) -> str:
        """Where the page is."""
        host = {"0.0.0.0": "localhost", "::": "localhost"}.get(self.host, self.host)
        return f"http://{f'[{host}]' if ':' in host else host}:{self.port}"

    def stop(self) -> None:
        """End session and server."""
        self.session.close()
        with _quiet():
            self._server.stop()

    # --- the panel ---------------------------------------------------------------------------------

    def _panel(self) -> None:
        g, s = self._gui, self.session
        self._verdict, self._plot = g.add_html(""), g.add_html("")
        if len(s.album) > 1:
            with g.add_folder("Grasp"):
                labels = [f"{k + 1}: {name}" for k, name in enumerate(s.album.names)]
                self._chosen = g.add_dropdown("of " + str(len(labels)), labels, initial_value=labels[0])
                leaf = g.add_button_group("leaf", ("previous", "next"))
            self._on(self._chosen, lambda v: s.leaf(labels.index(v)))

            def leafed(_: Any) -> None:
                step = 1 if leaf.value == "next" else -1
                s.leaf(s.state.number + step, step)

            leaf.on_click(leafed)
        with g.add_folder("Load"):
            self._force = g.add_slider("force [N]", 0.0, 1.0, 0.001, 0.0)
            self._torque = g.add_slider("torque [N·m]", 0.0, 1.0, 0.001, 0.0)
            first = g.add_button("as at first")
        self._on(self._force, lambda v: s.change(lambda x: x.with_force(v), "force"))
        self._on(self._torque, lambda v: s.change(lambda x: x.with_torque(v), "torque"))
        first.on_click(lambda _: s.change(ViewState.weighted))
        with g.add_folder("Grasp as it is assumed"):
            self._factor = g.add_slider("preload ×", 0.0, MOST_PRELOAD, 0.01, 1.0)
            self._friction = g.add_slider("friction", 0.0, MOST_FRICTION, 0.01, 1.0)
            self._eta = g.add_slider("normals ± [°]", 0.0, MOST_TILT, 0.1, 0.0)
        self._on(self._factor, lambda v: s.change(lambda x: x.preloaded(v), "factor"))
        self._on(self._friction, lambda v: s.change(lambda x: x.with_friction(v), "friction"))
        self._on(self._eta, lambda v: s.change(lambda x: x.with_normals(float(np.radians(v))), "eta"))
        self._actuators = g.add_folder("Actuators, one by one", expand_by_default=False)
        with g.add_folder("Seen"):
            plane = g.add_dropdown("map", MAP_PLANES, initial_value=MAP_PLANES[0])
            motion = g.add_checkbox("slip motion", True)
            self._shown = {
                name: g.add_checkbox(label, True)
                for name, label in (("hand", "hand"), ("cones", "friction cones"), ("forces", "contact forces"))
            }
            self._clear = g.add_slider("object", 0.05, 1.0, 0.05, OBJECT_OPACITY)
        self._on(plane, lambda v: s.change(lambda x: x.with_plane(v)))
        self._on(motion, self._set_motion)
        for box in self._shown.values():
            self._on(box, lambda _: s.redraw())
        self._on(self._clear, self._set_opacity)
        with g.add_folder("Mouse", expand_by_default=False):
            g.add_markdown(HELP)
        self._notes = g.add_markdown("")

    def _on(self, control: Any, do: Any) -> None:
        """What a control does when the user, not the page, sets it."""

        async def changed(event: Any) -> None:
            if event.client is not None:
                do(control.value)

        control.on_update(changed)

    def _set_motion(self, on: bool) -> None:
        self.session.moving = on

    def _set_opacity(self, value: float) -> None:
        if "object" in self._nodes:
            self._nodes["object"].opacity = value

    # --- the scene, as `Canvas` --------------------------------------------------------------------

    def say(self, text: str) -> None:
        """A message on every page."""
        for client in self._server.get_clients().values():
            client.add_notification("Not read", text, color="red", with_close_button=True)

    def put(self, state: ViewState, stage: Stage) -> None:
        """The solids of a grasp, and its controls."""
        with self._server.atomic():
            for name, node in self._nodes.items():
                if name not in ("object", "inside"):  # which go with their carrier
                    node.remove()
            self._nodes = {}
            self._put_solids(stage)
            self._put_load(state, stage)
            camera = self._server.initial_camera
            camera.position, camera.look_at, camera.up = (tuple(map(float, v)) for v in _look(stage))
            self._scene.set_up_direction(tuple(map(float, stage.up)))
            self._put_actuators(stage)
            self._force.max, self._torque.max = stage.force_reach, stage.torque_reach
            self._force.step, self._torque.step = stage.force_reach / 500, stage.torque_reach / 500
            self._notes.content = "\n\n".join(f"*{note}*" for note in stage.notes)
        for client in self._server.get_clients().values():
            client.camera.position, client.camera.look_at, client.camera.up_direction = _look(stage)

    def _put_solids(self, stage: Stage) -> None:
        n, scene = self._nodes, self._scene
        vertices, faces = stage.object
        n["carrier"] = scene.add_frame("/object", show_axes=False)
        n["object"] = scene.add_mesh_simple(
            "/object/solid", vertices, faces, opacity=self._clear.value, side="double", flat_shading=True
        )
        # what can be grabbed hides from the mouse what is behind it: the inside of the object does not hide the handle
        inside = scene.add_mesh_simple("/object/inside", vertices, faces, opacity=0.0, side="back", cast_shadow=False)
        n["inside"] = inside
        inside.on_drag("right", modifier="cmd/ctrl")(self._pull)
        inside.on_drag("left", modifier="cmd/ctrl")(self._twist)
        if stage.hand is not None:
            n["hand"] = scene.add_mesh_simple("/hand", *stage.hand, color=STEEL, side="double", flat_shading=True)
        elif len(stage.fingers):
            thick = 0.05 * stage.size
            n["hand"] = scene.add_line_segments("/hand", stage.fingers, np.array(FINGER_COLOR), thickness=thick)
        cones = scene.add_mesh_simple("/cones", *stage.cones(), color=CONE_COLOR, opacity=0.22, side="double")
        n["cones"] = cones
        for i, c in enumerate(stage.grasp.contacts):
            place = tuple(map(float, c.position))
            n[f"contact {i}"] = scene.add_icosphere(
                f"/contacts/{i}", 0.035 * stage.size, position=place, subdivisions=2
            )
        axes = 0.25 * stage.size
        n["axes"] = scene.add_frame("/origin", axes_length=axes, axes_radius=axes / 30, origin_radius=axes / 20)

    def _put_load(self, state: ViewState, stage: Stage) -> None:
        n, scene, size = self._nodes, self._scene, stage.size
        thin = {"shaft_radius": 0.018 * size, "head_radius": 0.045 * size, "head_length": 0.1 * size}
        n["forces"] = scene.add_arrows("/forces", np.zeros((0, 2, 3)), FORCE_COLOR, **thin)
        thick = {"shaft_radius": 0.03 * size, "head_radius": 0.075 * size, "head_length": 0.16 * size}
        n["load"] = scene.add_arrows("/load", np.zeros((0, 2, 3)), GREY, **thick)
        thickness = 0.018 * size
        n["map"] = scene.add_line_segments("/map", np.zeros((1, 2, 3)), CURVE, thickness=thickness, visible=False)
        n["tip"] = scene.add_icosphere("/tip", 0.08 * size, color=GREY)
        n["tip"].on_drag("left")(self._drag_tip)
        pose = {"position": tuple(map(float, state.at)), "wxyz": tuple(map(float, matrix_quaternion(state.frame)))}
        n["handle"] = scene.add_transform_controls(
            "/handle", scale=0.5 * size, line_width=2.0, disable_sliders=True, depth_test=False, opacity=0.8, **pose
        )
        n["handle"].on_update(self._turn)

    def _put_actuators(self, stage: Stage) -> None:
        for slider in self._preloads:
            slider.remove()
        self._preloads = []
        grasp = stage.grasp
        commands, made = grasp.command, []
        with self._actuators:
            for i, name in enumerate(grasp.mechanism.actuators):
                unit = words.actuator_unit(grasp, name)
                end = MOST_PRELOAD * float(np.abs(commands).max(initial=0.0)) or LOCKED_REACH[unit]
                low = -end if (commands < 0).any() else 0.0
                slider = self._gui.add_slider(f"{name} [{unit}]", low, end, end / 300, float(commands[i]))
                self._on(slider, lambda v, i=i: self.session.change(lambda x: x.commanded(i, v), "actuator"))
                made.append(slider)
        self._preloads = made  # at once: other threads see none of them, or all
        self._actuators.visible = bool(self._preloads)
        self._factor.visible = bool(commands.any())

    def draw(self, state: ViewState, stage: Stage, reply: Reply | None, what: Shown, source: str) -> None:
        """What changes with a state and its reply."""
        n = self._nodes
        with self._server.atomic():
            n["object"].color = what.object_color
            n["load"].points, n["load"].colors = what.load.astype(np.float32), np.array(what.color, dtype=np.uint8)
            n["tip"].position, n["tip"].color = tuple(map(float, what.tip)), what.color
            color = GREY if what.grey else FORCE_COLOR
            n["forces"].points, n["forces"].colors = what.forces.astype(np.float32), np.array(color, dtype=np.uint8)
            n["forces"].visible = self._shown["forces"].value
            n["cones"].visible = self._shown["cones"].value
            if "hand" in n:
                n["hand"].visible = self._shown["hand"].value
            for i, spot in enumerate(what.contacts):
                n[f"contact {i}"].color = spot
            self._draw_map(what.map)
            if source != "handle":
                n["handle"].position = tuple(map(float, state.at))
                n["handle"].wxyz = tuple(map(float, matrix_quaternion(state.frame)))
            self._verdict.content = verdict_html(what)
            self._plot.content = map_svg(state, stage, what)
            self._set_controls(state, stage, source)

    def _draw_map(self, found: ShownMap | None) -> None:
        line = self._nodes["map"]
        line.visible = found is not None and len(found.outline) > 1
        if found is None or not line.visible:
            return
        lines = np.stack([found.outline, np.roll(found.outline, -1, axis=0)], axis=1).astype(np.float32)
        if not np.array_equal(lines, line.points):
            line.points = lines
        line.colors = np.array(GREY if found.grey else CURVE, dtype=np.uint8)

    def _set_controls(self, state: ViewState, stage: Stage, source: str) -> None:
        """Bring the panel to the state, but for what the user holds."""
        grasp = state.grasp
        mu = float(np.mean(grasp.mu))
        scale = float(np.abs(grasp.command).max(initial=0.0))
        factor = float(np.abs(state.command).max(initial=0.0)) / scale if scale else 1.0
        wanted = {
            "force": (self._force, min(float(np.linalg.norm(state.force)), stage.force_reach)),
            "torque": (self._torque, min(float(np.linalg.norm(state.torque)), stage.torque_reach)),
            "factor": (self._factor, min(factor, MOST_PRELOAD)),
            "friction": (self._friction, min(state.friction * mu, MOST_FRICTION)),
            "eta": (self._eta, float(np.degrees(state.eta))),
        }
        for name, (control, value) in wanted.items():
            if name != source and abs(control.value - value) > MIN_LOAD:
                control.value = value
        if source != "actuator":
            for slider, value in zip(self._preloads, state.command, strict=True):
                if abs(slider.value - value) > MIN_LOAD:
                    slider.value = float(value)
        if len(self.session.album) > 1:
            label = f"{state.number + 1}: {self.session.album.names[state.number]}"
            if self._chosen.value != label:
                self._chosen.value = label

    def move(self, motion: SlipMotion | None, seconds: float) -> None:
        """The object along its motion."""
        carrier = self._nodes.get("carrier")
        if carrier is None or (motion is None and not self._moved):
            return
        position, rotation = motion.pose(seconds) if motion else (np.zeros(3), np.eye(3))
        with self._server.atomic():
            carrier.position, carrier.wxyz = tuple(map(float, position)), tuple(map(float, matrix_quaternion(rotation)))
        self._moved = motion is not None

    # --- the mouse ---------------------------------------------------------------------------------
    # Asynchronous, so that viser calls them in the order of the events; none of them waits for anything.

    async def _turn(self, event: Any) -> None:
        frame, at = quaternion_matrix(event.target.wxyz), np.array(event.target.position, dtype=float)
        self.session.change(lambda x: x.turned(frame).moved(at), "handle")

    async def _drag_tip(self, event: Any) -> None:
        stage = self.session.stage
        end = np.array(event.end_position, dtype=float)

        def dragged(x: ViewState) -> ViewState:
            step = _within(end - x.at, LOAD_ARROW * stage.size)
            if x.is_torque:
                return x.twisted(step / stage.metres_per_newton_metre)
            return x.pulled(step / stage.metres_per_newton)

        self.session.change(dragged)

    async def _pull(self, event: Any) -> None:
        """MuJoCo's gesture: a force from where the object was grabbed to the mouse."""
        stage = self.session.stage
        at, _, step = self._dragged(event)
        force = _within(step, LOAD_ARROW * stage.size) / stage.metres_per_newton
        self.session.change(lambda x: x.pulled(force, at=at))

    async def _twist(self, event: Any) -> None:
        """MuJoCo's gesture: a torque that turns the near side of the object after the mouse."""
        stage = self.session.stage
        _, back, step = self._dragged(event)
        torque = np.cross(back, _within(step, LOAD_ARROW * stage.size)) / stage.metres_per_newton_metre
        self.session.change(lambda x: x.twisted(torque))

    def _dragged(self, event: Any) -> tuple[Any, Any, Any]:
        """Where on the object, as it stands in the grasp, the gesture began; the unit vector to the viewer; the drag.

        The inside of the object is grabbed, and the drag measured in a plane there that faces the viewer. Both are
        brought to the outside, which the mouse points at.
        """
        if event.phase == "start" or self._start is None:
            eye = np.array(event.client.camera.position, dtype=float)
            inside = np.array(event.start_position, dtype=float)
            carrier = self._nodes["carrier"]
            turned, moved = quaternion_matrix(carrier.wxyz), np.array(carrier.position, dtype=float)
            eye_there, inside_there = turned.T @ (eye - moved), turned.T @ (inside - moved)
            share = first_hit(self.session.stage.object_triangles, eye_there, inside_there)
            back = (eye - inside) / np.linalg.norm(eye - inside)
            self._start = eye_there + share * (inside_there - eye_there), back, inside, share
        at, back, inside, share = self._start
        return at, back, share * (np.array(event.end_position, dtype=float) - inside)


def _listening(host: str, port: int) -> Any:
    """viser's server, without what would leave this machine, and deaf to the pages of others.

    Raises:
        InputError: viser is not installed, or begins a server in a way that leaves its door open.
    """
    try:
        import viser
    except ImportError:
        raise InputError("a live page needs viser: pip install 'handfast[view]'") from None

    class LoopbackServer(viser.ViserServer):
        def request_share_url(self, verbose: bool = True) -> None:
            """There is no link through a stranger's machine."""

    with _quiet():
        with Doorkeeper(host).at_the_door(dressed) as guarded:
            server = LoopbackServer(host=host, port=port, verbose=False)
        if not guarded:
            server.stop()
            raise InputError(f"viser {viser.__version__} cannot be kept from the pages of others; 1.1 can")
        return server


@contextmanager
def _quiet() -> Iterator[None]:
    """viser greets, and takes its leave, on standard output."""
    with redirect_stdout(io.StringIO()):
        yield


def _look(stage: Stage) -> tuple[Any, Any, Any]:
    return stage.eye, stage.target, stage.up


def _within(v: Any, longest: float) -> Any:
    length = float(np.linalg.norm(v))
    return v * min(1.0, longest / length) if length > 0 else v
