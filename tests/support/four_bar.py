"""A finger on a four-bar linkage, written as MJCF, and where its joints are in closed form."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np


@dataclass(frozen=True)
class FourBar:
    """Lengths [m] of crank, coupler and rocker, and between the two fixed pins, which lie on x; hinges along z."""

    crank: float = 0.02
    coupler: float = 0.05
    rocker: float = 0.04
    ground: float = 0.05

    def pins(self, angle: float) -> tuple[np.ndarray, np.ndarray]:
        """(2,) ends of the crank, at an angle [rad] from x, and of the rocker: the upper of the two circles' points."""
        b = self.crank * np.array([np.cos(angle), np.sin(angle)])
        d = np.array([self.ground, 0.0])
        far = np.linalg.norm(d - b)
        along = (far**2 + self.coupler**2 - self.rocker**2) / (2 * far)
        x = (d - b) / far
        return b, b + along * x + np.sqrt(max(0.0, self.coupler**2 - along**2)) * np.array([-x[1], x[0]])

    def joints(self, angle: float) -> dict[str, float]:
        """Values of the joints, all zero where the crank stands upright."""

        def absolute(at: float) -> np.ndarray:
            b, c = self.pins(at)
            d = np.array([self.ground, 0.0])
            return np.array([at, np.arctan2(*(c - b)[::-1]), np.arctan2(*(c - d)[::-1])])

        turned = absolute(angle) - absolute(np.pi / 2)
        crank, coupler, rocker = (turned + np.pi) % (2 * np.pi) - np.pi
        return {"crank": float(crank), "coupler": float(coupler - crank), "rocker": float(rocker)}

    def write(self, folder: Path, pin: str = "", motor: str = '<motor name="m" joint="crank"/>') -> Path:
        """The MJCF file: the tip is on the coupler, above its far end."""
        b, c = self.pins(np.pi / 2)
        d = np.array([self.ground, 0.0])
        path = folder / "four-bar.xml"
        default = f'<connect name="pin" body1="coupler" body2="rocker" anchor="{c[0] - b[0]} {c[1] - b[1]} 0"/>'
        path.write_text(f"""<mujoco model="four-bar"><compiler angle="radian"/>
          <default><geom type="capsule" size=".004"/><joint axis="0 0 1" range="-3 3"/></default>
          <worldbody><body name="palm"><geom type="box" size=".01 .01 .01" pos="0 -.03 0"/>
            <body name="crank"><joint name="crank"/><geom fromto="0 0 0 {b[0]} {b[1]} 0"/>
              <body name="coupler" pos="{b[0]} {b[1]} 0"><joint name="coupler"/>
                <geom fromto="0 0 0 {c[0] - b[0]} {c[1] - b[1]} 0"/>
                <site name="end" pos="{c[0] - b[0]} {c[1] - b[1]} .004"/>
                <geom name="tip" type="sphere" size=".008" pos="{c[0] - b[0]} {c[1] - b[1] + 0.03} 0"/></body></body>
            <body name="rocker" pos="{d[0]} {d[1]} 0"><joint name="rocker"/>
              <site name="pivot" pos="{c[0] - d[0]} {c[1] - d[1]} 0"/>
              <geom fromto="0 0 0 {c[0] - d[0]} {c[1] - d[1]} 0"/></body></body></worldbody>
          <equality>{pin or default}</equality><actuator>{motor}</actuator></mujoco>""")
        return path
